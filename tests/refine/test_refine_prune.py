"""Laws of leaving out what no view would miss."""

import numpy as np
import pytest

from rein3d_jax.rasterize import rasterize
from rein3d_jax.refine.prune import contribution, prune_to
from rein3d_jax.refine.views import camera_of


@pytest.fixture
def weighed(toy, raster):
    scene, views, _ = toy()
    cameras = [camera_of(views, index) for index in range(len(views.rgb))]
    return scene, cameras, contribution(scene, cameras, config=raster)


def alphas(scene, cameras, raster, buffers):
    frames = [rasterize(scene, camera, config=raster, buffers=buffers) for camera in cameras]
    return np.stack([np.asarray(frame.alpha) for frame in frames])


def test_contributions_sum_to_the_mean_alpha(weighed, raster, buffers) -> None:
    scene, cameras, weight = weighed
    # float32 sums of 256 pixels by 12 views in another order
    np.testing.assert_allclose(weight.sum(), alphas(scene, cameras, raster, buffers).mean(), rtol=1e-4)
    assert not np.any(np.asarray(weight)[~np.asarray(scene.alive)])


def test_a_budget_is_kept_to_the_one_and_keeps_the_heaviest(weighed) -> None:
    scene, _, weight = weighed
    for count in (0, 1, 17, 40, 1000):
        left = np.asarray(prune_to(scene, weight, count).alive)
        assert left.sum() == min(count, 40)
        if 0 < count < 40:
            chosen, lost = np.asarray(weight)[left], np.asarray(weight)[np.asarray(scene.alive) & ~left]
            assert chosen.min() >= lost.max()
