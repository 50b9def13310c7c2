"""Programs are forgotten where they hold too many maps, and only there."""

import jax
import jax.numpy as jnp
import pytest

from experiments import compiled_programs
from experiments.compiled_programs import MAPS, forget_when_many


@pytest.mark.skipif(not MAPS.exists(), reason="counts maps where Linux lists them")
@pytest.mark.parametrize(("many", "kept"), [(0, 0), (10**9, 1)])
def test_programs_are_forgotten_where_they_are_many(monkeypatch, many, kept):
    program = jax.jit(lambda x: x + 1)
    program(jnp.zeros(3))
    monkeypatch.setattr(compiled_programs, "MANY", many)
    forget_when_many()
    assert program._cache_size() == kept
    assert float(program(jnp.zeros(3))[0]) == 1  # compiled again where it was forgotten
