"""Parameters for the depth network that nobody had to train, nor XLA to draw: an untrained network's own take thirty
seconds to compile."""

import jax
import numpy as np
import pytest

from rein3d_jax.networks.depth import depth_shapes


@pytest.fixture(scope="session")
def random_network():
    """Parameters of a config's sizes, none of them 0: kernels that keep a signal's size, scales about 1."""

    def made(config):
        rng = np.random.default_rng(0)

        def leaf(path, shape):
            noise = rng.normal(size=shape.shape).astype(np.float32)
            if len(shape.shape) > 1:
                return noise / np.float32(np.sqrt(np.prod(shape.shape[:-1])))
            return np.float32(path[-1].key == "scale") + np.float32(0.1) * noise

        return jax.tree_util.tree_map_with_path(leaf, depth_shapes(config))

    return made
