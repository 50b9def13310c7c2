"""Weights add up to the picture, and the median lies where the oracle's transmittance crosses one half."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import ALPHA_CUT, ALPHA_MAX, EQUIRECTANGULAR, PINHOLE
from rein3d_jax.rasterize import accumulated_weight, allocate, median_distance, rasterize
from rein3d_jax.rasterize.pixels import pixel_features
from rein3d_jax.rasterize.project import project

MODELS = pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])


def dense(scene, camera, config):
    """Splats in depth order, and alpha (n, h, w) of each at each pixel: plain NumPy in float64."""
    splats = jax.tree.map(np.asarray, project(scene, camera, config=config))
    order = np.argsort(np.where(splats.visible, splats.distance, np.inf))
    offset = np.asarray(pixel_features(camera), np.float64) - splats.mean[order][:, None, None]
    white = np.einsum("nij,nhwj->nhwi", splats.axes[order].astype(np.float64), offset)
    raw = np.exp(splats.log_opacity[order][:, None, None] - 0.5 * np.sum(white**2, axis=-1))
    raw[(raw < ALPHA_CUT) | ~splats.visible[order][:, None, None]] = 0.0
    return order, splats.distance[order], np.minimum(raw, ALPHA_MAX)


@MODELS
def test_weights_are_the_oracles_and_sum_to_alpha(model, scene_of, camera_of, roomy) -> None:
    scene, camera = scene_of(), camera_of(model)
    weight = accumulated_weight(scene, camera, config=roomy)
    order, _, alpha = dense(scene, camera, roomy)
    through = np.cumprod(1 - alpha, axis=0)
    expected = np.zeros(len(order))
    expected[order] = (alpha * np.concatenate([np.ones_like(through[:1]), through[:-1]])).sum((1, 2))
    # alpha rounds to 3e-6 of itself here, a float32 sum of n = 512 positive terms to sqrt(n) eps = 3e-6 of their sum.
    np.testing.assert_allclose(weight, expected, rtol=2e-5, atol=1e-5)
    total = float(rasterize(scene, camera, config=roomy).alpha.sum())
    np.testing.assert_allclose(float(weight.sum()), total, rtol=1e-4)  # as above, of 60 x 512 terms: 2e-5
    assert not np.any(np.asarray(weight)[~np.asarray(scene.alive)])


@MODELS
def test_median_is_where_half_is_left(model, scene_of, camera_of, roomy) -> None:
    scene, camera = scene_of(count=200), camera_of(model)
    scene = scene.replace(opacity_logits=jnp.full(200, 2.0), log_scales=scene.log_scales + 0.7)
    config = allocate(scene, [camera], config=roomy)
    median = median_distance(scene, camera, config=config)
    _, distance, alpha = dense(scene, camera, config)
    through = np.cumprod(1 - alpha, axis=0)
    crossed = through <= 0.5
    expected = np.where(crossed.any(0), distance[crossed.argmax(0)], 0.0)
    # Where transmittance grazes one half, float32 may cross at the next splat: not more than a pixel in a hundred.
    assert np.mean(np.abs(median - expected) > 1e-4) < 0.01
    assert np.mean(expected > 0) > 0.3


def test_without_distance_the_rest_stays_and_there_is_none(scene_of, camera_of, roomy) -> None:
    camera = camera_of(PINHOLE)
    bare = rasterize(scene_of(), camera, config=dataclasses.replace(roomy, distance=False))
    whole = rasterize(scene_of(), camera, config=roomy)
    assert bare.distance is None
    np.testing.assert_allclose(bare.rgb, whole.rgb, atol=5e-6)  # the same sums, vectorised otherwise
    assert jnp.all(whole.distance >= 0)
