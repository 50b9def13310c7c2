"""300 random Gaussians against the dense oracle in float64: needles, specks and wide splats, over poles and seam."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.rasterize import RasterizeConfig, allocate

MODELS = pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])


def in_float64(tree):
    return jax.tree.map(lambda x: x.astype(jnp.float64) if jnp.issubdtype(x.dtype, jnp.floating) else x, tree)


@MODELS
def test_image_and_gradient_equal_the_float64_oracle(model, scene_of, fast, slow) -> None:
    scene = scene_of(seed=3, count=300)
    pose = upright(jnp.array([0.1, -0.2, 0.05]), 0.3, 0.2)
    camera = pinhole_camera(pose, 48, 1.6) if model == PINHOLE else equirectangular_camera(pose, 32)
    config = RasterizeConfig(antialias=False)
    buffers = allocate(scene, [camera], config=config)
    image, gradient = fast(scene, camera, config=config, buffers=buffers)
    with jax.enable_x64(True):
        exact = dataclasses.replace(camera, **{
            name: in_float64(getattr(camera, name)) for name in ("world_from_camera", "focal", "centre")
        })  # fmt: skip
        oracle, expected = slow(in_float64(scene), exact, config=config)
        oracle, expected = jax.tree.map(np.asarray, (oracle, expected))
    for actual, value in zip(image, oracle, strict=True):
        # A splat's edge is cut at 1/255: where the two round to different sides, 4e-3 appears or
        # not, so one pixel in a thousand may do so.
        error = np.abs(actual - value)
        assert np.quantile(error, 0.999) < 1e-4 and error.max() < 2e-2
    for name, value in expected.items():
        error = np.linalg.norm(gradient[name] - value) / np.linalg.norm(value)
        assert error < 1e-3, (name, error)  # float32 sums of mixed signs: a thousandth hides in an optimiser's noise
