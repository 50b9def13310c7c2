"""A recipe loads as it was dumped, and whatever is wrong in it is refused in one line that names the key."""

from dataclasses import dataclass, field

import jax
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.config import dump_config, load_config
from rein3d_jax.errors import InputError


@dataclass(frozen=True)
class Lift:
    stride: int = 1
    opacity: float = 0.99

    def __post_init__(self):
        if self.stride < 1:
            raise InputError(f"stride must be at least 1, not {self.stride}")


@dataclass(frozen=True)
class Rates:
    means: float = 1.6e-4
    colours: float | None = None


@dataclass(frozen=True)
class Refine:
    steps: int = 300
    shuffle: bool = True
    size: tuple[int, int] = (192, 192)
    ladder: tuple[float, ...] = (1.0, 0.5)
    rates: Rates = field(default_factory=Rates)

    def __post_init__(self):
        if self.steps < 0:
            raise InputError(f"refine.steps must not be negative; {self.steps} is")


@dataclass(frozen=True)
class Recipe:
    seed: int = 0
    input: str = "room.png"
    distance: str | None = None
    lift: Lift = field(default_factory=Lift)
    refine: Refine = Refine(steps=100, rates=Rates(colours=0.5))  # not Refine's own defaults


RECIPE = """
seed = 3
[lift]
opacity = 1
[refine]
size = [64, 32]
ladder = []
[refine.rates]
means = 0.01
"""


@pytest.fixture
def recipe(tmp_path):
    path = tmp_path / "quick.toml"
    path.write_text(RECIPE)
    return path


def test_a_recipe_fills_what_it_names_and_leaves_the_other_defaults(recipe):
    rates = Rates(means=0.01, colours=0.5)
    refine = Refine(steps=100, size=(64, 32), ladder=(), rates=rates)
    loaded = load_config(Recipe, recipe)
    assert loaded == Recipe(seed=3, lift=Lift(opacity=1.0), refine=refine)
    assert type(loaded.lift.opacity) is float


def test_the_result_is_a_static_argument_of_jit(recipe):
    steps = jax.jit(lambda x, config: x * config.refine.steps, static_argnames="config")
    assert steps(2, load_config(Recipe, recipe)) == 200


def test_overrides_lie_over_the_recipe_and_the_last_one_wins(recipe):
    overrides = ["seed=4", "seed=5", "input=my room.png", "refine.rates.means=1", "refine.size=[8, 8]"]
    loaded = load_config(Recipe, recipe, [*overrides, 'distance="a=b.exr"', "refine.shuffle=false"])
    assert (loaded.seed, loaded.input, loaded.distance) == (5, "my room.png", "a=b.exr")
    assert (loaded.refine.rates.means, loaded.refine.size, loaded.refine.shuffle) == (1.0, (8, 8), False)


def test_none_is_written_as_a_word(recipe):
    assert load_config(Recipe, recipe, ["refine.rates.colours=none"]).refine.rates.colours is None


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("refine.steps=many", "refine.steps must be a whole number, not 'many'"),
        ("refine.steps=1.0", "refine.steps must be a whole number, not 1.0"),
        ("refine.steps=true", "refine.steps must be a whole number, not True"),
        ("lift.opacity=true", "lift.opacity must be a number, not True"),
        ("lift.opacity=nan", "lift.opacity must be a number, not nan"),
        ("refine.shuffle=1", "refine.shuffle must be true or false, not 1"),
        ("input=12", "input must be text in quotes, not 12"),
        ("refine.size=[1, 2, 3]", "refine.size must be a list [a whole number, a whole number], not [1, 2, 3]"),
        ("refine.ladder=2.0", "refine.ladder must be a list [a number, ...], not 2.0"),
        ("refine.ladder=[1.0, true]", "refine.ladder[1] must be a number, not True"),
        ("refine.rates.colours=[]", 'refine.rates.colours must be a number, or "none", not []'),
        ("lift=3", "lift must be a table of settings, not 3"),
        ("seed.x=3", "seed must be a whole number, not {'x': 3}"),
        ("refine.stesp=3", "refine.stesp is not a setting; did you mean refine.steps?"),
        ("refnie.steps=3", "refnie is not a setting; did you mean refine?"),
        ("lift.rates.means=3", "lift.rates is not a setting; did you mean refine.rates?"),
        ("lift.colours=3", "lift.colours is not a setting; did you mean refine.rates.colours?"),  # of the same name
        ("seed=1\nlift.stride=2", r"seed must be a whole number, not '1\nlift.stride=2'"),
        ("lift.stride=0", "lift.stride must be at least 1, not 0"),
        ("refine.steps=-1", "refine.steps must not be negative; -1 is"),
        ("seed", "--set seed: write it as stage.key=value"),
        ("=3", "--set =3: write it as stage.key=value"),
    ],
)
def test_a_bad_setting_is_refused_by_its_full_name(recipe, override, message):
    with pytest.raises(InputError) as refusal:
        load_config(Recipe, recipe, [override])
    assert str(refusal.value) == message


def test_a_setting_without_a_default_must_be_given(tmp_path):
    @dataclass(frozen=True)
    class Bare:
        input: str

    (tmp_path / "bare.toml").write_text("")
    with pytest.raises(InputError, match=r"^input is missing: give it in the recipe or with --set input="):
        load_config(Bare, tmp_path / "bare.toml")


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "No such file"),
        (b"seed = 1\nlift.stride 2\n", "line 2"),
        (b"seed = 1\nseed = 2\n", "line 2"),
        (b"seed = \xff\n", "utf-8"),
    ],
)
def test_an_unreadable_recipe_is_named_with_the_place(tmp_path, content, reason):
    path = tmp_path / "broken.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=reason) as refusal:
        load_config(Recipe, path)
    assert str(refusal.value).startswith(f"{path}: ")


# Lone surrogates are no text that UTF-8 can hold; "none" is how no value is written.
texts = st.text(st.characters(exclude_categories=("Cs",)))
numbers = st.floats(allow_nan=False)
recipes = st.builds(
    Recipe,
    seed=st.integers(),
    input=texts,
    distance=st.none() | texts.filter(lambda text: text != "none"),
    lift=st.builds(Lift, stride=st.integers(1), opacity=numbers),
    refine=st.builds(
        Refine,
        steps=st.integers(0),
        shuffle=st.booleans(),
        ladder=st.lists(numbers).map(tuple),
        rates=st.builds(Rates, means=numbers, colours=st.none() | numbers),
    ),
)


@given(recipes)
def test_a_dumped_recipe_loads_back_equal(tmp_path_factory, config):
    path = tmp_path_factory.getbasetemp() / "dumped.toml"
    path.write_text(dump_config(config), "utf-8")
    assert load_config(Recipe, path) == config
