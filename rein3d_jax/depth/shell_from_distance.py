"""The room's shell from a known distance: the smallest upright box that holds what the panorama saw.

Unlike `room_shell`, which reads a picture's edges, this reads geometry: it takes no guess, and says how much of what
was seen lies on the box, so that a room that is no box can be told from one that is.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.rotations import matrix_from_quats, yaw_quat
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles
from rein3d_jax.scene import Panorama

_OUTLIERS = 0.01  # share of the sphere that may lie beyond a face: a doorway, a few wrong pixels
_YAWS = 90  # tries over a quarter turn: to 1 degree, at which a 5 m wall is off by 4 cm at its ends
_ON_SHELL = 0.05  # relative distance within which a pixel counts as lying on the box


def _quantiles(values: jax.Array, weights: jax.Array) -> jax.Array:
    """The two weighted quantiles (2,) of values (n,) beyond which outliers lie."""
    order = jnp.argsort(values)
    cumulative = jnp.cumsum(weights[order]) / jnp.sum(weights)
    found = jnp.searchsorted(cumulative, jnp.array([_OUTLIERS, 1 - _OUTLIERS]))
    return values[order][jnp.minimum(found, values.shape[0] - 1)]


@jax.jit
def shell_from_distance(panorama: Panorama) -> tuple[RoomShell, jax.Array]:
    """The shell, and its support () in [0, 1]: the share of the known sphere that lies on it.

    The yaw is the one whose bounding rectangle is smallest, as a box's is along its own axes.
    """
    height, width = panorama.distance.shape
    stride = max(height // 64, 1)  # the sorts below cost by the pixel, and quantiles need no more of them
    rays = pixel_rays(height, width)[::stride, ::stride].reshape(-1, 3)
    distance = panorama.distance[::stride, ::stride].ravel()
    known = panorama.valid[::stride, ::stride].ravel()
    weights = pixel_solid_angles(height, width)[::stride, ::stride].ravel() * known
    points = rays * jnp.where(known, distance, 0.0)[:, None]

    def rectangle(yaw):
        rotated = jnp.matmul(points, matrix_from_quats(yaw_quat(yaw)), precision="highest")
        return jnp.stack([_quantiles(rotated[:, 0], weights), _quantiles(rotated[:, 1], weights)])

    yaws = jnp.arange(_YAWS) * (jnp.pi / 2 / _YAWS)
    rectangles = jax.lax.map(rectangle, yaws)  # (_YAWS, 2, 2)
    best = jnp.argmin(jnp.prod(rectangles[..., 1] - rectangles[..., 0], axis=-1))
    (back, front), (right, left) = rectangles[best]
    low, high = _quantiles(points[:, 2], weights)
    # The origin is inside: a face behind it is put a hand's breadth away.
    shell = RoomShell(
        yaw=yaws[best],
        walls=jnp.maximum(jnp.stack([front, left, -back, -right]), 0.05),
        floor=jnp.maximum(-low, 0.05),
        ceiling=jnp.maximum(high, 0.05),
    )
    expected, _ = meet_shell(shell, jnp.zeros(3), rays)
    on_shell = jnp.abs(distance / expected - 1) < _ON_SHELL
    return shell, jnp.sum(weights * on_shell) / jnp.maximum(jnp.sum(weights), 1e-9)
