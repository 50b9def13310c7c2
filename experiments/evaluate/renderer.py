"""Renderers: what a method shows to a camera, the one question that every protocol asks."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from typing import NamedTuple

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import EQUIRECTANGULAR
from rein3d_jax.geometry.poses import equirectangular_camera, rigid
from rein3d_jax.geometry.resample import perspective_crop
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.rasterize import RasterizeConfig, allocate, render
from rein3d_jax.restore.restorer import Restorer
from rein3d_jax.scene import Camera, Gaussians, Video


class Rendering(NamedTuple):
    """A rendered picture with its holes."""

    rgb: jax.Array  # (..., h, w, 3) sRGB in [0, 1], not premultiplied
    alpha: jax.Array  # (..., h, w) 1 = something is shown
    distance: jax.Array  # (..., h, w) metres along the ray, 0 where nothing is shown

    def over(self, backdrop: jax.Array) -> jax.Array:
        """(..., h, w, 3): the picture over one colour (3,)."""
        return jnp.clip(self.rgb * self.alpha[..., None] + (1 - self.alpha[..., None]) * backdrop, 0, 1)


Renderer = Callable[[Camera], Rendering]


def scene_renderer(gaussians: Gaussians, cameras: Sequence[Camera], raster: RasterizeConfig) -> Renderer:
    """A scene as the rasterizer shows it, with buffers measured on all `cameras` beforehand: none grows, and
    nothing compiles, while it is timed."""
    kinds = {}
    for camera in cameras:
        kinds.setdefault(_kind(camera), []).append(camera)
    buffers = {kind: allocate(gaussians, alike, config=raster) for kind, alike in kinds.items()}

    def renderer(camera: Camera) -> Rendering:
        kind = _kind(camera)
        frame, buffers[kind] = render(gaussians, camera, config=raster, buffers=buffers.get(kind))
        return Rendering(jnp.clip(safe_divide(frame.rgb, frame.alpha[..., None]), 0, 1), frame.alpha, frame.distance)

    return renderer


def filled_renderer(base: Renderer, restorer: Restorer, *, rows: int, observed: float, anchored: bool) -> Renderer:
    """`base` with its holes (alpha below `observed`) filled by a restorer of panoramas: of the panorama itself, or,
    for a pinhole camera, as the filled panorama of `rows` rows at the same place shows them. A restorer that is
    `anchored` sees the panorama at the origin first, as of a clip of two frames."""

    @lru_cache(maxsize=1)
    def anchor(height: int) -> tuple[jax.Array, ...]:
        camera = equirectangular_camera(origin_pose(), height)
        return (*base(camera), camera.world_from_camera)

    def filled(camera: Camera) -> Rendering:
        frames = [anchor(camera.height)] * anchored + [(*base(camera), camera.world_from_camera)]
        video = restorer(Video(*map(jnp.stack, zip(*frames, strict=True))), jax.random.key(0))
        return Rendering(video.rgb[-1], jnp.ones_like(video.alpha[-1]), video.distance[-1])

    @lru_cache(maxsize=1)  # views at one place follow one another
    def around(place: tuple[float, ...]) -> tuple[jax.Array, jax.Array]:
        pose = rigid(origin_pose()[:3, :3], jnp.array(place))
        shown = filled(equirectangular_camera(pose, rows))
        return pose, jnp.concatenate([shown.rgb, shown.distance[..., None]], axis=-1)

    def of_pinhole(camera: Camera) -> Rendering:
        seen = base(camera)
        crop = _crop(*reversed(around(tuple(camera.world_from_camera[:3, 3].tolist()))), camera)
        hole = seen.alpha < observed
        rgb = jnp.where(hole[..., None], crop[..., :3], seen.rgb)
        return Rendering(rgb, jnp.ones_like(seen.alpha), jnp.where(hole, crop[..., 3], seen.distance))

    return lambda camera: filled(camera) if camera.model == EQUIRECTANGULAR else of_pinhole(camera)


def with_panoramas(cameras: Sequence[Camera], rows: int) -> list[Camera]:
    """`cameras`, and the panoramic ones of `rows` rows that `filled_renderer` renders for them."""
    places = {tuple(camera.world_from_camera[:3, 3].tolist()) for camera in cameras if camera.model != EQUIRECTANGULAR}
    poses = [rigid(origin_pose()[:3, :3], jnp.array(place)) for place in sorted(places)]
    return [*cameras, *(equirectangular_camera(pose, rows) for pose in poses)]


def first_of_each_kind(cameras: Sequence[Camera]) -> list[Camera]:
    """One camera of each model and size: rendering for these compiles all programs."""
    return list({_kind(camera): camera for camera in reversed(cameras)}.values())


def _kind(camera: Camera) -> tuple:
    return camera.model, camera.height, camera.width


_crop = jax.jit(perspective_crop)
