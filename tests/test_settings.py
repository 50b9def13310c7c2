"""A config holds what its settings allow and nothing else, and says why in one line."""

import dataclasses
import math

import pytest

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, meaning_of, setting


@dataclasses.dataclass(frozen=True)
class Oven(Settings):
    """How something is baked."""

    degrees: float = setting(180.0, "inside", within="(0, 300]", unit="Celsius")
    shelves: tuple[int, ...] = setting((1, 2), "from below", within="[1, 4]")
    heat: str = setting("fan", "how it spreads", among=("fan", "top"))
    timer: float | None = setting(None, "until the bell; none: no bell", within="[0, inf)", unit="minutes")
    name: str = "oven"


@pytest.mark.parametrize(
    "allowed", [{"degrees": 300}, {"degrees": 1e-9}, {"shelves": ()}, {"timer": 0.0}, {"timer": None}, {"heat": "top"}]
)
def test_what_is_allowed_is_kept(allowed):
    assert dataclasses.asdict(Oven(**allowed)).items() >= allowed.items()


@pytest.mark.parametrize(
    ("refused", "reason"),
    [
        ({"degrees": 0}, "degrees must be in (0, 300], not 0"),
        ({"degrees": math.nan}, "degrees must be in (0, 300], not nan"),
        ({"degrees": math.inf}, "degrees must be in (0, 300], not inf"),
        ({"shelves": (1, 5)}, "shelves must be in [1, 4], not (1, 5)"),
        ({"heat": "grill"}, 'heat must be one of fan, top, not "grill"'),
        ({"timer": -1.0}, "timer must be in [0, inf), not -1.0"),
    ],
)
def test_what_is_not_is_refused_by_name(refused, reason):
    with pytest.raises(InputError) as error:
        Oven(**refused)
    assert str(error.value) == reason


def test_a_field_tells_its_meaning():
    meanings = {field.name: meaning_of(field) for field in dataclasses.fields(Oven)}
    assert (meanings["degrees"].text, meanings["degrees"].unit) == ("inside", "Celsius")
    assert meanings["name"] is None
    assert hash(Oven()) == hash(Oven())  # a static argument of jit
