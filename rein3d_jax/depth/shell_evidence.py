"""What a picture says about a box as the room it was taken in: edges along its twelve lines, and how well its walls,
ceiling and floor part the picture's colours.

A box is (6,) numbers: its yaw, then the logs of its four walls' distances and of its ceiling's height, over the
camera's height. Whatever stands in the room hides its lines, and has edges and colours of its own: where it is known
where the room itself is `seen`, only that counts."""

from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.picture_edges import blur, edge_support, edge_tensors
from rein3d_jax.depth.picture_parts import ROWS, colour_bins, mutual_information
from rein3d_jax.depth.shell_outline import shell_edges, shell_parts
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import pixels_from_rays

_WORKING_HEIGHT = 256  # pixels; the noise and blur scales are tied to it
_WIDE, _SHARP = (1.0, 3.0), (0.7, 2.0)  # pixels of blur: to find the basin, and to end in it
_COARSE, _FINE = 12, 32  # points along each line: to rank boxes, and to refine one
_HIDDEN = 0.05  # what a hidden piece of a line counts, so that a room full of things keeps a size


@struct.dataclass
class Evidence:
    """All that is read off the picture."""

    wide: jax.Array  # (h, w, 3) edge tensors
    sharp: jax.Array  # (h, w, 3) edge tensors
    bins: jax.Array  # (n, k) colour bins
    seen: jax.Array | None  # (h, w) in [0, 1], how far the room itself is seen there; None: not known


@partial(jax.jit, static_argnames=("noise", "texture"))
def picture_evidence(rgb: jax.Array, seen: jax.Array | None = None, *, noise: float, texture: float) -> Evidence:
    """The evidence of a panorama (h, 2 h, 3) in sRGB; `noise` and `texture` are `edge_tensors`'."""
    rgb = jax.image.resize(rgb, (_WORKING_HEIGHT, 2 * _WORKING_HEIGHT, 3), "linear")
    tensors = edge_tensors(rgb, noise=noise, texture=texture)
    wide, sharp = (sum(blur(tensors, sigma) for sigma in sigmas) / len(sigmas) for sigmas in (_WIDE, _SHARP))
    bins = colour_bins(rgb)
    if seen is not None:
        share = jax.image.resize(seen, (ROWS, 2 * ROWS), "linear").reshape(-1, 1)
        bins *= share * jnp.sum(bins) / jnp.maximum(jnp.sum(bins * share), 1e-6)
    return Evidence(wide, sharp, bins, seen)


def coarse_support(box: jax.Array, evidence: Evidence, edge_weights: tuple[float, float, float]) -> jax.Array:
    """Mean edge support () in [0, 1] along a box's lines, from afar."""
    return _support(shell_of(box, 1.0), evidence.wide, evidence.seen, _COARSE, edge_weights)


def fine_support(box: jax.Array, evidence: Evidence, edge_weights: tuple[float, float, float]) -> jax.Array:
    """The same from near by."""
    return _support(shell_of(box, 1.0), evidence.sharp, evidence.seen, _FINE, edge_weights)


def colour_information(box: jax.Array, evidence: Evidence) -> jax.Array:
    """Nats () that a box's parts say about the picture's colours."""
    return mutual_information(shell_parts(shell_of(box, 1.0), ROWS, 2 * ROWS).reshape(-1, 3), evidence.bins)


def shell_of(box: jax.Array, camera_height: float) -> RoomShell:
    """The room's shell in metres; yaw within 45 degrees."""
    quarters = jnp.round(box[0] / (jnp.pi / 2))
    walls = jnp.roll(jnp.exp(box[1:5]), quarters.astype(jnp.int32))
    height = jnp.asarray(camera_height, box.dtype)
    return RoomShell(box[0] - quarters * jnp.pi / 2, walls * height, height, jnp.exp(box[5]) * height)


def box_of(shell: RoomShell) -> jax.Array:
    """The inverse of `shell_of`, over the shell's own height of the camera."""
    logs = jnp.log(jnp.append(shell.walls, shell.ceiling) / shell.floor)
    return jnp.concatenate([shell.yaw[None], logs])


def _support(
    shell: RoomShell, tensors: jax.Array, seen: jax.Array | None, points: int, edge_weights: tuple[float, float, float]
) -> jax.Array:
    """Mean edge support along the twelve lines, weighted by the angle each piece spans -> () in [0, 1]."""
    starts, ends = shell_edges(shell)
    along = ((jnp.arange(points) + 0.5) / points)[:, None]
    places = starts[:, None] + along * (ends - starts)[:, None]  # (12, points, 3)
    normals = jnp.cross(starts, ends)
    area = safe_norm(normals, keepdims=True)
    # d(angle)/d(along) = |start x end| / |place|^2
    weights = area / jnp.sum(places * places, axis=-1) * jnp.repeat(jnp.array(edge_weights), 4)[:, None]
    if seen is not None:
        weights *= _HIDDEN + sample_sphere(seen[..., None], *pixels_from_rays(places, *seen.shape))[..., 0]
    support = edge_support(tensors, places, (normals / area)[:, None])
    return jnp.sum(weights * support) / jnp.sum(weights)
