"""The front door: Gaussians + camera -> Frame, differentiable in the Gaussians and in the camera's pose.

    import jax.numpy as jnp
    from rein3d_jax.geometry.poses import equirectangular_camera, upright
    from rein3d_jax.rasterize import RasterizeConfig, allocate, rasterize
    from rein3d_jax.scene import Gaussians

    scene = Gaussians(jnp.array([[2.0, 0, 0]]), jnp.full((1, 3), -2.0), jnp.array([[1.0, 0, 0, 0]]),
                      jnp.array([3.0]), jnp.ones((1, 1, 3)), jnp.array([True]))
    camera = equirectangular_camera(upright(jnp.zeros(3)), height=64)
    config = allocate(scene, [camera], config=RasterizeConfig())   # outside jit: measures the buffers
    frame = rasterize(scene, camera, config=config)                # jit, grad, vmap over cameras
    assert frame.rgb.shape == (64, 128, 3) and frame.overflow == 0
"""

import dataclasses
import math
from collections.abc import Sequence

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.rasterize.composite import composite_chunks
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.cull import at_least_one, in_view
from rein3d_jax.rasterize.listing import list_splats
from rein3d_jax.rasterize.pixels import from_tiles, grid
from rein3d_jax.rasterize.project import Splats, project
from rein3d_jax.rasterize.tile import needed_pairs
from rein3d_jax.scene import Camera, Gaussians


@struct.dataclass
class Frame:
    """What one camera sees."""

    rgb: jax.Array  # (h, w, 3) premultiplied: the scene over black
    alpha: jax.Array  # (h, w) in [0, 1)
    distance: jax.Array | None  # (h, w) metres along the ray, mean over what is seen; 0 where nothing is
    needed: jax.Array  # (4,) buffer sizes this view called for, in the order of RasterizeConfig.buffers
    overflow: jax.Array  # () entries dropped; 0 or the picture is not the scene's


def _rasterize(
    gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig, means2d_offset: jax.Array | None = None
) -> Frame:
    if min(config.buffers) < 1:
        raise InputError("rasterize: buffer capacities are 0; call allocate(gaussians, cameras, config=config) first")
    if camera.model == EQUIRECTANGULAR and camera.width % config.tile:
        raise InputError(f"rasterize.tile {config.tile} does not divide the panorama's width {camera.width}")
    splats, chunks, _, needed = list_splats(gaussians, camera, config=config, means2d_offset=means2d_offset)
    overflow = jnp.sum(jnp.maximum(needed - jnp.array(config.buffers), 0))
    tiles = composite_chunks(splats, _values(splats, config), chunks, camera, config.tile)
    image = from_tiles(tiles, camera, config.tile)
    distance = safe_divide(image[..., 3], image[..., 4]) if config.distance else None
    return Frame(image[..., :3], image[..., -1], distance, needed, overflow)


def _values(splats: Splats, config: RasterizeConfig) -> jax.Array:
    """The values (n, 3 or 4) that are composited."""
    return jnp.concatenate([splats.rgb, splats.distance[:, None]], axis=-1) if config.distance else splats.rgb


rasterize = jax.jit(_rasterize, static_argnames=("config",))
rasterize.__doc__ = """The Frame that a camera sees of Gaussians. Pure; differentiable in every float of both.

`config` must come from `allocate`; `means2d_offset` (n, 2) is `project`'s: zeros that densification differentiates by.
Check `frame.overflow == 0`, or call `render`, which grows the buffers itself. Raises InputError where buffers are unset
or the tile does not divide a panorama's width. Deterministic: the same inputs give the same bytes on a CPU."""


def _measure(gaussians, camera, *, config):
    gaussians = at_least_one(gaussians)
    mask = in_view(gaussians, camera, config=config)
    pairs = needed_pairs(project(gaussians, camera, config=config), camera, config=config)
    return jnp.concatenate([jnp.sum(mask)[None], pairs])


_measure = jax.jit(_measure, static_argnames=("config",))


def bucket(count: int) -> int:
    """The next of 1, 1.25, 1.5, 1.75 x 2^k: near sizes share a compiled program, at most 25 % is idle."""
    count = max(count, 64)
    step = 1 << max(count.bit_length() - 3, 0)
    return -(-count // step) * step


def allocate(gaussians: Gaussians, cameras: Sequence[Camera], *, config: RasterizeConfig, slack: float = 1.1):
    """The config with buffers measured on `cameras`, times `slack` for the motion of an optimisation.

    Runs outside jit. An all-new camera may still overflow: `Frame.overflow` tells.
    """
    bare = dataclasses.replace(config, visible_capacity=0, row_capacity=0, pair_capacity=0, chunk_capacity=0)
    measured = jnp.stack([_measure(gaussians, camera, config=bare) for camera in cameras]).max(axis=0)
    visible, rows, pairs = (int(x * slack) for x in measured)
    # Each tile wastes less than one chunk, so this bound holds whatever the spread over tiles.
    return enlarge(config, visible, rows, pairs, pairs // config.chunk + math.prod(grid(cameras[0], config.tile)))


def enlarge(config: RasterizeConfig, *needed: int) -> RasterizeConfig:
    """The config with buffers of at least the sizes `needed`, in the order of `RasterizeConfig.buffers`, never
    smaller than it had."""
    visible, rows, pairs, chunks = (max(old, bucket(new)) for old, new in zip(config.buffers, needed, strict=True))
    return dataclasses.replace(
        config, visible_capacity=visible, row_capacity=rows, pair_capacity=pairs, chunk_capacity=chunks
    )


def render(
    gaussians: Gaussians, camera: Camera, *, config: RasterizeConfig = RasterizeConfig()
) -> tuple[Frame, RasterizeConfig]:
    """The frame, and the config to reuse: `rasterize` that allocates, and allocates again on overflow."""
    if min(config.buffers) == 0:
        config = allocate(gaussians, [camera], config=config)
    while True:
        frame = rasterize(gaussians, camera, config=config)
        if int(frame.overflow) == 0:
            return frame, config
        config = enlarge(config, *(int(x * 1.1) for x in frame.needed))
