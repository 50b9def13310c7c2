"""The cheap test of what is in view never loses what projection would show."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.rasterize import RasterizeConfig
from rein3d_jax.rasterize.cull import gather_in_view, in_view
from rein3d_jax.rasterize.project import project
from rein3d_jax.scene import Gaussians

COUNT = 4096
CONFIG = RasterizeConfig(antialias=False)  # the wider support


@jax.jit
def seen_and_in_view(gaussians, camera):
    return project(gaussians, camera, config=CONFIG).visible, in_view(gaussians, camera, config=CONFIG)


def cloud(seed: int) -> Gaussians:
    """All around, from specks to a metre, half of them needles."""
    keys = jax.random.split(jax.random.key(seed), 5)
    means = 3 * jax.random.normal(keys[0], (COUNT, 3))
    log_scales = jax.random.uniform(keys[1], (COUNT, 3), minval=-7.0, maxval=0.0)
    quats = jax.random.normal(keys[2], (COUNT, 4))
    logits = jax.random.uniform(keys[3], (COUNT,), minval=-5.0, maxval=8.0)
    return Gaussians(means, log_scales, quats, logits, jnp.zeros((COUNT, 1, 3)), jnp.arange(COUNT) % 5 > 0)


@pytest.mark.parametrize("fov", [0.4, 1.6, 2.1, 2.9])
def test_visible_implies_in_view(fov) -> None:
    for seed in range(3):
        visible, kept = seen_and_in_view(cloud(seed), pinhole_camera(upright(jnp.zeros(3)), 32, fov))
        assert visible.sum() > 50
        assert not np.any(visible & ~kept)
        assert fov > 2 or kept.mean() < 0.6  # and it does cull


def test_visible_implies_in_view_of_a_panorama() -> None:
    visible, kept = seen_and_in_view(cloud(0), equirectangular_camera(upright(jnp.zeros(3)), 16))
    assert visible.any() and not np.any(visible & ~kept)


def test_gathering_keeps_what_is_in_view_in_order() -> None:
    scene = cloud(0)
    mask = scene.alive & (scene.means[:, 0] > 2)
    count = int(mask.sum())
    gathered, ids = gather_in_view(scene, mask, count + 3)
    np.testing.assert_array_equal(gathered.alive, [True] * count + [False] * 3)
    np.testing.assert_array_equal(gathered.means[:count], scene.means[mask])
    np.testing.assert_array_equal(ids[:count], np.flatnonzero(mask))
