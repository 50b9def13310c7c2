"""A toy scene seen by 12 views of 16 pixels, and one configuration, so that the tests share a compiled step."""

import functools
from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.pinhole import focal_from_fov
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize
from rein3d_jax.refine import DensifyConfig, RefineConfig, Views, ViewsConfig, first_snapshot, refine
from rein3d_jax.scene import Gaussians

COUNT, SPARE, SIZE, VIEWS = 40, 20, 16, 12
EXTENT = 2.0  # metres
RASTER = RasterizeConfig()
# Roomier than `refine` would ask for, so that it keeps these buffers and the tests share one compiled step.
BUFFERS = Buffers(visible=96, rows=256, pairs=512, chunks=128)
CONFIG = RefineConfig(
    steps=10, batch=2, evaluate_every=5, sh_degree=1, sh_degree_every=4, min_scale=0.0,
    views=ViewsConfig(size=SIZE, held_out_every=4),
    densify=DensifyConfig(start=4, every=4, share=1.0, reset_every=100),
)  # fmt: skip


def make_scene(scale: float = 1.0) -> Gaussians:
    """A cloud of ellipsoids 2 m from the origin and SPARE dead slots, all lengths times `scale`."""
    keys = jax.random.split(jax.random.key(0), 4)
    count = COUNT + SPARE
    direction = jax.random.normal(keys[0], (count, 3)).at[:, 2].multiply(0.3)
    means = scale * 2 * direction / jnp.linalg.norm(direction, axis=-1, keepdims=True)
    log_scales = jax.random.uniform(keys[1], (count, 3), minval=-2.5, maxval=-1.0) + jnp.log(scale)
    quats = jax.random.normal(keys[2], (count, 4))
    quats = quats / jnp.linalg.norm(quats, axis=-1, keepdims=True)
    sh = 0.8 * jax.random.normal(keys[3], (count, 4, 3)).at[:, 1:].set(0.0)
    return Gaussians(means, log_scales, quats, jnp.ones(count), sh, jnp.arange(count) < COUNT)


def make_views(scale: float = 1.0) -> Views:
    """The scene as it is, from places around the origin."""
    cameras = [
        pinhole_camera(upright(scale * 0.3 * jnp.array([np.cos(a), np.sin(a), 0.1]), 1.7 * a), SIZE, np.pi / 2)
        for a in np.arange(VIEWS)
    ]
    rgb = jnp.stack([rasterize(make_scene(scale), c, config=RASTER, buffers=BUFFERS).rgb for c in cameras])
    poses = jnp.stack([camera.world_from_camera for camera in cameras])
    focal = jnp.full(VIEWS, focal_from_fov(np.pi / 2, SIZE), jnp.float32)
    return Views(rgb, jnp.ones((VIEWS, SIZE, SIZE)), poses, focal)


def blurred(scene: Gaussians) -> Gaussians:
    """A wrong start: all of one grey, larger, and fainter."""
    grey = jnp.zeros_like(scene.sh)
    return scene.replace(sh=grey, log_scales=scene.log_scales + 0.3, opacity_logits=scene.opacity_logits - 1)


@pytest.fixture(scope="session")
def toy() -> Callable:
    """scale -> (the scene, its views, a wrong start)."""
    return functools.cache(lambda scale=1.0: (make_scene(scale), make_views(scale), blurred(make_scene(scale))))


@pytest.fixture(scope="session")
def fit() -> Callable:
    """(a start, views, config) -> all snapshots of its refinement, with the shared key and buffers."""

    def snapshots(start, views, config, still=None):
        first = first_snapshot(start, views, extent=EXTENT, config=config, raster=RASTER, still=still)
        first = first.replace(buffers=jnp.array(BUFFERS))
        return list(refine(first, views, jax.random.key(0), config=config, raster=RASTER))

    return snapshots


@pytest.fixture
def config() -> RefineConfig:
    return CONFIG


@pytest.fixture
def raster() -> RasterizeConfig:
    return RASTER


@pytest.fixture
def buffers() -> Buffers:
    return BUFFERS
