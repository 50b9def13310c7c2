"""One small scene, one configuration and roomy buffers: most tests of the room share their compiled programs."""

import dataclasses
import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import PINHOLE
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera, upright
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize
from rein3d_jax.rasterize.reference import rasterize_reference
from rein3d_jax.scene import Camera, Gaussians

COUNT = 60
CONFIG = RasterizeConfig(chunk=4)  # so that a tile has several chunks
ROOMY = Buffers(visible=64, rows=192, pairs=576, chunks=160)  # every Gaussian in each of at most 9 tiles


def make_scene(seed: int = 0, count: int = COUNT) -> Gaussians:
    """Splats on all sides, some over a pole and some over the seam, from specks to a third of a radian."""
    keys = jax.random.split(jax.random.key(seed), 7)
    direction = jax.random.normal(keys[0], (count, 3))
    special = jnp.array([[0, 0, 1.0], [0, 0, -1], [0.01, 0, 1], [-1, 0.001, 0], [-1, -0.01, 0], [-1, 0, 0.1]])
    direction = direction.at[: len(special)].set(special)
    distance = jax.random.uniform(keys[1], (count, 1), minval=0.5, maxval=4.0)
    means = distance * direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)
    log_scales = jnp.log(distance) + jax.random.uniform(keys[2], (count, 3), minval=-5.0, maxval=-1.1)
    opacity_logits = jax.random.uniform(keys[4], (count,), minval=-3.0, maxval=4.0)
    sh = 0.5 * jax.random.normal(keys[5], (count, 4, 3))
    alive = jax.random.uniform(keys[6], (count,)) < 0.9
    return Gaussians(means, log_scales, jax.random.normal(keys[3], (count, 4)), opacity_logits, sh, alive)


def make_camera(model: str, pose: jax.Array | None = None) -> Camera:
    """20 pixels are no whole number of tiles; a panorama of 16 x 32 has poles and seam."""
    pose = upright(jnp.array([0.1, -0.2, 0.05]), 0.3, 0.2) if pose is None else pose
    return pinhole_camera(pose, 20, 1.6) if model == PINHOLE else equirectangular_camera(pose, 16)


def picture(gaussians: Gaussians, camera: Camera, config: RasterizeConfig, buffers: Buffers) -> tuple:
    """(rgb, alpha, alpha / distance): what the oracle returns."""
    frame = rasterize(gaussians, camera, config=config, buffers=buffers)
    return frame.rgb, frame.alpha, safe_divide(frame.alpha, frame.distance)


def oracle(gaussians: Gaussians, camera: Camera, config: RasterizeConfig, buffers: Buffers) -> tuple:
    """The reference, which has no buffers."""
    return rasterize_reference(gaussians, camera, config=config)


def differentiate(paint: Callable) -> Callable:
    """(gaussians, camera, config, buffers) -> (picture, gradient by every float and by the pose) of a random linear
    loss."""

    @functools.partial(jax.jit, static_argnames=("config", "buffers"))
    def both(gaussians: Gaussians, camera: Camera, config: RasterizeConfig, buffers: Buffers = ROOMY):
        def loss(floats, pose):
            moved = dataclasses.replace(camera, world_from_camera=pose)
            image = paint(gaussians.replace(**floats), moved, config, buffers)
            rng = np.random.default_rng(1)  # not jax's: it draws other numbers where floats are 64 bits
            return sum(jnp.vdot(jnp.asarray(rng.normal(size=x.shape), x.dtype), x) for x in image), image

        names = ("means", "log_scales", "quats", "opacity_logits", "sh")
        floats = {name: getattr(gaussians, name) for name in names}
        gradient = jax.grad(loss, argnums=(0, 1), has_aux=True)
        (by_floats, by_pose), image = gradient(floats, camera.world_from_camera)
        return image, by_floats | {"pose": by_pose}

    return both


FAST, SLOW = differentiate(picture), differentiate(oracle)


@pytest.fixture
def config() -> RasterizeConfig:
    return CONFIG


@pytest.fixture
def roomy() -> Buffers:
    return ROOMY


@pytest.fixture
def scene_of() -> Callable:
    return make_scene


@pytest.fixture
def camera_of() -> Callable:
    return make_camera


@pytest.fixture
def fast() -> Callable:
    """Picture and gradient of `rasterize`, in roomy buffers unless others are given."""
    return FAST


@pytest.fixture
def slow() -> Callable:
    """Picture and gradient of the oracle."""
    return SLOW
