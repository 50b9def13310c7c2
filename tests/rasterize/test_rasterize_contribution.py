"""Weights are the oracle's and add up to the picture."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX, EQUIRECTANGULAR, PINHOLE
from rein3d_jax.rasterize import accumulated_weight, rasterize
from rein3d_jax.rasterize.pixels import pixel_features
from rein3d_jax.rasterize.project import project

MODELS = pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])


def dense(scene, camera, config):
    """The order of depth (n,), and alpha (n, h, w) of each splat at each pixel: plain NumPy in float64."""
    splats = jax.tree.map(np.asarray, project(scene, camera, config=config))
    order = np.argsort(np.where(splats.visible, splats.distance, np.inf))
    offset = np.asarray(pixel_features(camera), np.float64) - splats.mean[order][:, None, None]
    white = np.einsum("nij,nhwj->nhwi", splats.axes[order].astype(np.float64), offset)
    raw = np.exp(splats.log_opacity[order][:, None, None] - 0.5 * np.sum(white**2, axis=-1))
    raw[(raw < ALPHA_CUT) | ~splats.visible[order][:, None, None]] = 0.0
    return order, np.minimum(raw, ALPHA_MAX)


@MODELS
def test_weights_are_the_oracles_and_sum_to_alpha(model, scene_of, camera_of, config, roomy) -> None:
    scene, camera = scene_of(), camera_of(model)
    weight = accumulated_weight(scene, camera, config=config, buffers=roomy)
    order, alpha = dense(scene, camera, config)
    through = np.cumprod(1 - alpha, axis=0)
    expected = np.zeros(len(order))
    expected[order] = (alpha * np.concatenate([np.ones_like(through[:1]), through[:-1]])).sum((1, 2))
    # alpha rounds to 3e-6 of itself here, a float32 sum of n = 512 positive terms to sqrt(n) eps = 3e-6 of their sum.
    np.testing.assert_allclose(weight, expected, rtol=2e-5, atol=1e-5)
    total = float(rasterize(scene, camera, config=config, buffers=roomy).alpha.sum())
    np.testing.assert_allclose(float(weight.sum()), total, rtol=1e-4)  # as above, of 60 x 512 terms: 2e-5
    assert not np.any(np.asarray(weight)[~np.asarray(scene.alive)])


def test_without_distance_the_rest_stays_and_there_is_none(scene_of, camera_of, config, roomy) -> None:
    camera = camera_of(PINHOLE)
    bare = rasterize(scene_of(), camera, config=dataclasses.replace(config, distance=False), buffers=roomy)
    whole = rasterize(scene_of(), camera, config=config, buffers=roomy)
    assert bare.distance is None
    np.testing.assert_allclose(bare.rgb, whole.rgb, atol=5e-6)  # the same sums, vectorised otherwise
    assert jnp.all(whole.distance >= 0)
