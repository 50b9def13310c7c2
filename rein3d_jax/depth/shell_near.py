"""The box that a picture bears out near the room that the depth network saw in it.

The network knows which room it is, but not to the pixel where its lines run, and takes its size from what rooms usually
are; the lines of the picture say both, but have many readings. So the fit starts from the network's room, may change
its size by some 12 % and each wall by some 6 % more, and counts only where the network sees the room itself and no
furniture. All of it is one pure function: random search, no gradients."""

from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.depth.room_shell import RoomShellConfig, climb
from rein3d_jax.depth.shell_evidence import (
    box_of,
    coarse_support,
    colour_information,
    fine_support,
    picture_evidence,
    shell_of,
)
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.scene import Panorama

# Standard deviations about the network's room: log of its size, log of each length beside that, yaw in radians.
_SIZE, _LENGTH, _YAW = 0.12, 0.06, 0.05
_PRIOR, _LAST_PRIOR = 0.02, 0.004  # loss of one squared standard deviation, at first and at last
_STARTS, _KEPT, _CHILDREN = 64, 16, 8
_COARSE_STEPS, _FINE_STEPS = (0.15, 0.02, 8), (0.02, 0.001, 12)  # first, last, rounds


@partial(jax.jit, static_argnames=("config",))
def fit_shell_near(rgb: jax.Array, background: jax.Array, seen: jax.Array, *, config: RoomShellConfig) -> RoomShell:
    """The shell, over the camera's height, of a level panorama (h, 2 h, 3) in sRGB, near an estimate of the empty
    room's distance (h, 2 h) over the camera's height; `seen` (h, 2 h) in [0, 1] is how far the room itself is seen
    there."""
    evidence = picture_evidence(rgb, seen, noise=config.noise, texture=config.texture)
    first = box_of(shell_from_distance(Panorama(rgb, background, jnp.ones(background.shape, bool)))[0])
    start, coarse, fine = jax.random.split(jax.random.key(config.seed), 3)
    sizes = jnp.linspace(-2, 2, _STARTS)[:, None] * _SIZE * jnp.array([0.0, 1, 1, 1, 1, 1])
    spread = jnp.array([_YAW, *[_LENGTH] * 5])
    boxes = first + sizes + spread * jax.random.normal(start, (_STARTS, 6))
    boxes = boxes.at[0].set(first)

    def descend(boxes, key, steps, support, prior):
        def loss(box):
            informed = config.colour_weight * colour_information(box, evidence)
            return prior * _unlikely(box, first) - support(box, evidence, config.edge_weights) - informed

        first_step, last_step, rounds = steps
        sizes = first_step * (last_step / first_step) ** jnp.linspace(0, 1, rounds)
        each = (jax.random.split(key, rounds), sizes)
        boxes, losses = jax.lax.scan(lambda boxes, x: climb(boxes, *x, loss, _CHILDREN), boxes, each)
        return boxes[jnp.argsort(losses[-1])]

    boxes = descend(boxes, coarse, _COARSE_STEPS, coarse_support, _PRIOR)[:_KEPT]
    return shell_of(descend(boxes, fine, _FINE_STEPS, fine_support, _LAST_PRIOR)[0], 1.0)


def _unlikely(box: jax.Array, first: jax.Array) -> jax.Array:
    """Squared standard deviations () of a box about the first one."""
    change = box[1:] - first[1:]
    size = jnp.mean(change)
    lengths = jnp.sum(((change - size) / _LENGTH) ** 2)
    return (size / _SIZE) ** 2 + lengths + ((box[0] - first[0]) / _YAW) ** 2
