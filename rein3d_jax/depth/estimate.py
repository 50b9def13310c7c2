"""Distance of a panorama that comes without one: by the trained network, in metres by the camera's height."""

from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.depth.complete import CompleteConfig
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.settings import setting


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
    """Metres along each ray and where there are any, both (h, 2 h), of a level panorama (h, 2 h, 3), sRGB in [0, 1], h
    a multiple of 32, taken `camera_height` metres above the floor; `parameters` are those of the network."""
    found = estimate_depth(parameters, rgb[None], config)
    return camera_height * jnp.exp(found.log_distance[0]), found.unknown[0] < 0
