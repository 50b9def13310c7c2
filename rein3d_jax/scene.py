"""The pytrees everything passes on. Fields only; the frames and units are in conventions.py."""

import jax
from flax import struct


@struct.dataclass
class Gaussians:
    """Splats in the world frame, in buffers of fixed capacity n; a dead slot keeps finite values."""

    means: jax.Array  # (n, 3) metres
    log_scales: jax.Array  # (n, 3) log metres
    quats: jax.Array  # (n, 4) wxyz, unit when alive
    opacity_logits: jax.Array  # (n,)
    sh: jax.Array  # (n, (degree + 1)^2, 3) spherical-harmonic coefficients of sRGB colour - 0.5
    alive: jax.Array  # (n,) bool


@struct.dataclass
class Camera:
    """One camera. The image size and the model are static: they fix shapes and code paths."""

    world_from_camera: jax.Array  # (4, 4) rigid
    focal: jax.Array  # (2,) fx, fy in pixels; ignored by an equirectangular camera
    centre: jax.Array  # (2,) cx, cy in pixels; ignored by an equirectangular camera
    model: str = struct.field(pytree_node=False)  # conventions.PINHOLE or conventions.EQUIRECTANGULAR
    width: int = struct.field(pytree_node=False)
    height: int = struct.field(pytree_node=False)


@struct.dataclass
class Panorama:
    """An equirectangular picture and the distance along each pixel's ray."""

    rgb: jax.Array  # (h, w, 3) sRGB in [0, 1]
    distance: jax.Array  # (h, w) metres, finite everywhere; meaningless where not valid
    valid: jax.Array  # (h, w) bool, distance is known
    doubt: jax.Array | None = None  # (h, w) mean relative error expected of an estimated distance; None: it was given


@struct.dataclass
class Video:
    """Equirectangular frames along one trajectory, rendered or restored."""

    rgb: jax.Array  # (t, h, w, 3) sRGB in [0, 1], not premultiplied
    alpha: jax.Array  # (t, h, w) 1 = observed
    distance: jax.Array  # (t, h, w) metres, 0 where alpha is 0
    world_from_camera: jax.Array  # (t, 4, 4)


@struct.dataclass
class Pair:
    """What a restorer learns from: a clip as the room is, and as its first frame, lifted, shows it (paper Sec. 3)."""

    clean: Video  # alpha 1 everywhere; frame 0, the first panorama, is the context anchor
    degraded: Video  # same poses; frame 0 stands at the world's origin
