"""Distance of a panorama that comes without one, in metres by the camera's height: by the trained network, the shell
that the picture's lines bear out near the network's room, and the picture's own edges."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.depth.complete import CompleteConfig
from rein3d_jax.depth.furnished import furnished_room, room_seen
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.depth.room_shell import RoomShellConfig, shell_distance
from rein3d_jax.depth.shell_near import fit_shell_near
from rein3d_jax.settings import setting

_TURNS = 8  # of a picture: the network's coarsest features are an eighth of a circle wide
_ROWS = 128  # what the shipped network was trained at; at 256 its first weights were off by a third more


@dataclass(frozen=True)
class DepthConfig(CompleteConfig):
    """Distance where none is given, and where it is not known."""

    method: str = setting(
        "network", "of a picture without distance: by the trained network, or an empty box", among=("network", "shell")
    )
    weights: str | None = setting(None, "folder of the network that train_depth wrote; none for the packaged one")


@struct.dataclass
class Estimate:
    """What is believed of a panorama's distances."""

    distance: jax.Array  # (h, 2 h) metres along each ray
    known: jax.Array  # (h, 2 h) bool, there is a distance: not the sky, not what is outside
    doubt: jax.Array  # (h, 2 h) mean relative error expected


@partial(jax.jit, static_argnames=("config", "shell"))
def estimate_distance(
    rgb: jax.Array,
    parameters: dict,
    camera_height: float,
    *,
    config: DepthNetworkConfig = DepthNetworkConfig(),
    shell: RoomShellConfig = RoomShellConfig(),
) -> Estimate:
    """The Estimate of a level panorama (h, 2 h, 3), sRGB in [0, 1], taken `camera_height` metres above the floor;
    `parameters` are those of the network, which sees _ROWS rows. A picture that is turned by eighths of a circle gets
    the same distances, turned."""
    turn = _brightest_turn(rgb)
    estimate = _estimate(jnp.roll(rgb, -turn, axis=1), parameters, camera_height, config, shell)
    return jax.tree.map(lambda x: jnp.roll(x, turn, axis=1), estimate)


def _brightest_turn(rgb: jax.Array) -> jax.Array:
    """Columns by which the brightest eighth of a picture is away from its start: a heading that is the room's own, so
    that neither the network's grid nor the shell's search depends on where the camera happened to face."""
    eighths = rgb.mean((0, 2)).reshape(_TURNS, -1).mean(1)
    return jnp.argmax(eighths) * (rgb.shape[1] // _TURNS)


def _estimate(
    rgb: jax.Array, parameters: dict, camera_height: float, config: DepthNetworkConfig, shell: RoomShellConfig
) -> Estimate:
    found = estimate_depth(parameters, jax.image.resize(rgb, (_ROWS, 2 * _ROWS, 3), "linear")[None], config)
    size = rgb.shape[:2]

    def at_size(x):
        return jax.image.resize(x[0], size, "linear")

    distance, background = jnp.exp(at_size(found.log_distance)), jnp.exp(at_size(found.log_background))
    box = fit_shell_near(rgb, background, room_seen(distance, background), config=shell)
    room = furnished_room(rgb, distance, background, shell_distance(box, *size))
    return Estimate(
        distance=camera_height * room.distance,
        known=at_size(found.unknown) < 0,
        doubt=jnp.exp(at_size(found.log_scale)),
    )
