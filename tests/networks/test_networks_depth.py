"""The distance network that comes with the package."""

import jax
import jax.numpy as jnp
import numpy as np

from experiments.reconstruct.inputs import SAMPLES
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import estimate_depth
from rein3d_jax.io.pictures.image import resize_panorama
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.networks.depth import SHIPPED_DEPTH, read_depth_network


def test_it_knows_where_the_floor_of_a_photograph_is():
    """Straight below, the distance is the camera's height; the ceiling is at most a few of them away."""
    rgb, _, _ = resize_panorama(read_rgb(SAMPLES / "hotel_room.jpg"), None, None, 128)
    estimate = jax.jit(estimate_depth, static_argnums=2)
    log = estimate(read_depth_network(), jnp.asarray(rgb)[None], DepthNetworkConfig()).log_distance[0]
    assert jnp.isfinite(log).all()
    assert np.abs(np.asarray(log[-4:])).max() < 0.15  # a network's estimate
    assert -1.5 < float(log[:4].mean()) < 1.1
    assert sum(file.stat().st_size for file in SHIPPED_DEPTH.iterdir()) < 20e6
