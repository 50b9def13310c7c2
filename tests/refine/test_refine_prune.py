"""Laws of leaving out what no view would miss."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.rasterize import rasterize
from rein3d_jax.refine.prune import contribution, prune_to, prune_within
from rein3d_jax.refine.views import camera_of


@pytest.fixture
def weighed(toy, raster):
    scene, views, _ = toy()
    cameras = [camera_of(views, index) for index in range(len(views.rgb))]
    return scene, cameras, contribution(scene, cameras, config=raster)


def alphas(scene, cameras, raster):
    return np.stack([np.asarray(rasterize(scene, camera, config=raster).alpha) for camera in cameras])


def test_contributions_sum_to_the_mean_alpha(weighed, raster) -> None:
    scene, cameras, weight = weighed
    # float32 sums of 256 pixels by 12 views in another order
    np.testing.assert_allclose(weight.sum(), alphas(scene, cameras, raster).mean(), rtol=1e-4)
    assert not np.any(np.asarray(weight)[~np.asarray(scene.alive)])


@pytest.mark.parametrize("tolerance", [0.0, 0.002, 0.02, 0.2])
def test_views_change_by_no_more_than_the_tolerance(weighed, raster, tolerance) -> None:
    scene, cameras, weight = weighed
    left = prune_within(scene, weight, tolerance)
    assert not np.any(np.asarray(left.alive & ~scene.alive))
    dropped = np.asarray(scene.alive & ~left.alive)
    assert np.asarray(weight)[dropped].sum() <= tolerance * (1 + 1e-5)  # float32
    grey = scene.replace(sh=jnp.zeros_like(scene.sh))  # 0.5 everywhere, over black: what is lost is alpha / 2
    after = grey.replace(alive=left.alive)
    pictures = [np.stack([np.asarray(rasterize(g, c, config=raster).rgb) for c in cameras]) for g in (grey, after)]
    assert np.abs(pictures[0] - pictures[1]).mean() <= tolerance + 1e-6  # float32
    if tolerance == 0.2:
        assert dropped.sum() > 5


def test_a_budget_is_kept_to_the_one_and_keeps_the_heaviest(weighed) -> None:
    scene, _, weight = weighed
    for count in (0, 1, 17, 40, 1000):
        left = np.asarray(prune_to(scene, weight, count).alive)
        assert left.sum() == min(count, 40)
        if 0 < count < 40:
            kept, lost = np.asarray(weight)[left], np.asarray(weight)[np.asarray(scene.alive) & ~left]
            assert kept.min() >= lost.max()
