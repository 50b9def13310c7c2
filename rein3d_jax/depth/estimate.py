"""Distance of a panorama that comes without one: by the trained network, in metres by the camera's height."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.depth.complete import CompleteConfig
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.settings import setting

_ROWS = 128  # what the shipped network was trained at; at 256 its first weights were off by a third more


@dataclass(frozen=True)
class DepthConfig(CompleteConfig):
    """Distance where none is given, and where it is not known."""

    method: str = setting(
        "shell", "of a picture without distance: an empty box, or the trained network", among=("shell", "network")
    )


@partial(jax.jit, static_argnames=("config",))
def estimate_distance(
    rgb: jax.Array, parameters: dict, camera_height: float, *, config: DepthNetworkConfig = DepthNetworkConfig()
) -> tuple[jax.Array, jax.Array]:
    """Metres along each ray and where there are any, both (h, 2 h), of a level panorama (h, 2 h, 3), sRGB in [0, 1],
    taken `camera_height` metres above the floor; `parameters` are those of the network, which sees _ROWS rows."""
    found = estimate_depth(parameters, jax.image.resize(rgb, (_ROWS, 2 * _ROWS, 3), "linear")[None], config)
    size = rgb.shape[:2]
    distance = camera_height * jnp.exp(jax.image.resize(found.log_distance[0], size, "linear"))
    return distance, jax.image.resize(found.unknown[0], size, "linear") < 0
