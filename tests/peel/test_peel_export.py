"""The layers' programs are made for accelerators as well, and give the same there as far as a CPU can tell."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.peel import behind_things, outside_of, without_things
from tests.peel.test_peel_room import POSE, ROWS, SHELL

PLATFORMS = ("cpu", "cuda", "tpu")


def same_when_exported(function, *given):
    exported = jax.export.export(jax.jit(function), platforms=PLATFORMS)(*given)
    assert exported.platforms == PLATFORMS
    pairs = zip(jax.tree.leaves(exported.call(*given)), jax.tree.leaves(function(*given)), strict=True)
    assert all(np.allclose(a, b, atol=1e-5) for a, b in pairs)  # one program or several: float32 rounding


def test_the_room_behind(furnished):
    def layer(panorama):
        taken = without_things(panorama, SHELL, POSE, rows=ROWS)
        return behind_things(taken, taken, SHELL)

    same_when_exported(layer, furnished)


def test_the_outside(with_window):
    same_when_exported(outside_of, with_window, jnp.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.0]]))
