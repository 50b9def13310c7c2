"""Pictures and videos at twice their rows and columns (paper Sec. 3.3: restored frames are super-resolved before the
scene is refined on them). What is finer has what was measured as the mean of its pixels."""

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.resample import sample_sphere_cubic
from rein3d_jax.scene import Panorama, Video
from rein3d_jax.upsample.config import BICUBIC, LEARNED, NONE, UpsampleConfig
from rein3d_jax.upsample.distance import finer_distance
from rein3d_jax.upsample.dual_aggregation import twice_as_fine
from rein3d_jax.upsample.measured import as_measured, borne_out
from rein3d_jax.upsample.reference import reference_colours


def upsample_picture(rgb: jax.Array, method: str, network: dict | None = None) -> jax.Array:
    """The picture (2 h, 4 h, 3) of an equirectangular one (h, 2 h, 3), sRGB in [0, 1], by a method but NONE; for
    LEARNED, `network` holds the parameters (`read_upsampler`'s), and h is a multiple of 32. Raises InputError without
    them."""
    if method == BICUBIC:
        return as_measured(_cubic(rgb), rgb)
    assert method == LEARNED, method
    if network is None:
        raise InputError('upsampling by "learned" needs the trained network: read_upsampler()')
    return as_measured(twice_as_fine(network, rgb), rgb)


def upsample_video(video: Video, panorama: Panorama, network: dict | None = None, *, config: UpsampleConfig) -> Video:
    """The video with frames (2 h, 4 h) for (h, 2 h); itself, where config.method is NONE. `panorama` is the input, at
    the world's origin. Raises InputError as `upsample_picture` does."""
    if config.method == NONE:
        return video
    parts = [_upsampled_frame(video, index, panorama, network, config) for index in range(len(video.rgb))]
    rgb, alpha, distance = (jnp.stack(part) for part in zip(*parts, strict=True))
    return Video(rgb, alpha, distance, video.world_from_camera)


def then_upsample(restore, panorama: Panorama, network: dict | None = None, *, config: UpsampleConfig):
    """The restorer `restore`, (Video, key) -> Video, with its video upsampled as `upsample_video` does."""
    return lambda video, key: upsample_video(restore(video, key), panorama, network, config=config)


def _upsampled_frame(video: Video, index: int, panorama: Panorama, network: dict | None, config: UpsampleConfig):
    """Colour, alpha and distance of a frame."""
    measured = video.rgb[index]
    rgb = upsample_picture(measured, config.method, network)
    distance = finer_distance(video.distance[index], rgb)
    if config.reference:
        known = reference_colours(panorama, video.world_from_camera[index], distance)
        weight = known.weight * borne_out(known.rgb, measured)
        rgb = as_measured(rgb + weight[..., None] * (known.rgb - rgb), measured)
    return rgb, jnp.repeat(jnp.repeat(video.alpha[index], 2, axis=0), 2, axis=1), distance


@jax.jit
def _cubic(rgb: jax.Array) -> jax.Array:
    """By cubics between pixels."""
    height, width = rgb.shape[:2]
    u, v = ((jnp.arange(2 * n) + 0.5) / 2 for n in (width, height))
    return sample_sphere_cubic(rgb, *jnp.broadcast_arrays(u[None], v[:, None]))
