"""The front door: Gaussians + camera -> Frame, differentiable in the Gaussians and in the camera's pose.

import jax.numpy as jnp
from rein3d_jax.geometry.poses import equirectangular_camera, upright
from rein3d_jax.rasterize import RasterizeConfig, allocate, rasterize
from rein3d_jax.scene import Gaussians

scene = Gaussians(jnp.array([[2.0, 0, 0]]), jnp.full((1, 3), -2.0), jnp.array([[1.0, 0, 0, 0]]),
                  jnp.array([3.0]), jnp.ones((1, 1, 3)), jnp.array([True]))
camera = equirectangular_camera(upright(jnp.zeros(3)), height=64)
config = RasterizeConfig()
buffers = allocate(scene, [camera], config=config)                # outside jit: measures them
frame = rasterize(scene, camera, config=config, buffers=buffers)  # jit, grad, vmap over cameras
assert frame.rgb.shape == (64, 128, 3) and frame.overflow == 0
"""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.rasterize.buffers import Buffers, bucket
from rein3d_jax.rasterize.composite import composite_chunks
from rein3d_jax.rasterize.config import RasterizeConfig
from rein3d_jax.rasterize.cull import at_least_one, in_view
from rein3d_jax.rasterize.listing import list_splats
from rein3d_jax.rasterize.pixels import from_tiles
from rein3d_jax.rasterize.project import Splats, project
from rein3d_jax.rasterize.tile import needed_lists
from rein3d_jax.scene import Camera, Gaussians


@struct.dataclass
class Frame:
    """What one camera sees."""

    rgb: jax.Array  # (h, w, 3) premultiplied: the scene over black
    alpha: jax.Array  # (h, w) in [0, 1)
    # (h, w) metres along the ray, harmonic mean over what is seen, or the little that a wall lets through of what lies
    # far behind it would move the wall; 0 where nothing is
    distance: jax.Array | None
    needed: jax.Array  # (4,) buffer sizes this view called for, in the order of `Buffers`
    overflow: jax.Array  # () entries dropped; 0 or the picture is not the scene's

    def over(self, backdrop: jax.Array) -> jax.Array:
        """The picture (h, w, 3) in [0, 1] over the colour `backdrop` (3,)."""
        return _over(self.rgb, self.alpha, backdrop)


@jax.jit
def _over(rgb: jax.Array, alpha: jax.Array, backdrop: jax.Array) -> jax.Array:
    return jnp.clip(rgb + (1 - alpha[..., None]) * backdrop, 0, 1)


def _rasterize(
    gaussians: Gaussians,
    camera: Camera,
    *,
    config: RasterizeConfig,
    buffers: Buffers,
    means2d_offset: jax.Array | None = None,
) -> Frame:
    if min(buffers) < 1:
        raise InputError(f"rasterize: {buffers} has an empty one; call allocate(gaussians, cameras, config=config)")
    if camera.model == EQUIRECTANGULAR and camera.width % config.tile:
        raise InputError(f"rasterize.tile {config.tile} does not divide the panorama's width {camera.width}")
    splats, chunks, _, needed = list_splats(
        gaussians, camera, config=config, buffers=buffers, means2d_offset=means2d_offset
    )
    overflow = jnp.sum(jnp.maximum(needed - jnp.array(buffers), 0))
    tiles = composite_chunks(splats, _values(splats, config), chunks, camera, config.tile)
    image = from_tiles(tiles, camera, config.tile)
    distance = safe_divide(image[..., 4], image[..., 3]) if config.distance else None
    return Frame(image[..., :3], image[..., -1], distance, needed, overflow)


def _values(splats: Splats, config: RasterizeConfig) -> jax.Array:
    """The values (n, 3 or 4) that are composited."""
    if not config.distance:
        return splats.rgb
    return jnp.concatenate([splats.rgb, safe_divide(jnp.ones(()), splats.distance)[:, None]], axis=-1)


rasterize = jax.jit(_rasterize, static_argnames=("config", "buffers"))
rasterize.__doc__ = """The Frame that a camera sees of Gaussians. Pure; differentiable in every float of both.

`buffers` are `allocate`'s; `means2d_offset` (n, 2) is `project`'s: zeros that densification differentiates by. Check
`frame.overflow == 0`, or call `render`, which grows the buffers itself. Raises InputError where one has no size or the
tile does not divide a panorama's width. Deterministic: the same inputs give the same bytes on a CPU."""


def _measure(gaussians, camera, *, config):
    gaussians = at_least_one(gaussians)
    mask = in_view(gaussians, camera, config=config)
    lists = needed_lists(project(gaussians, camera, config=config), camera, config=config)
    return jnp.concatenate([jnp.sum(mask)[None], lists])


_measure = jax.jit(_measure, static_argnames=("config",))


def allocate(
    gaussians: Gaussians, cameras: Sequence[Camera], *, config: RasterizeConfig, slack: float = 1.1
) -> Buffers:
    """The buffers that `cameras` need, measured, times `slack` for the motion of an optimisation.

    Runs outside jit. An all-new camera may still overflow: `Frame.overflow` tells.
    """
    measured = jnp.stack([_measure(gaussians, camera, config=config) for camera in cameras]).max(axis=0)
    return Buffers(*(bucket(int(x * slack)) for x in measured))


def render(
    gaussians: Gaussians,
    camera: Camera,
    *,
    config: RasterizeConfig = RasterizeConfig(),
    buffers: Buffers | None = None,
) -> tuple[Frame, Buffers]:
    """The frame, and the buffers to reuse: `rasterize` that allocates, and enlarges on overflow."""
    if buffers is None:
        buffers = allocate(gaussians, [camera], config=config)
    while True:
        frame = rasterize(gaussians, camera, config=config, buffers=buffers)
        if int(frame.overflow) == 0:
            return frame, buffers
        buffers = buffers.enlarged(frame.needed, slack=1.1)
