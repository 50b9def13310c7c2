"""The distance network's weights in a folder of safetensors."""

from pathlib import Path

import jax

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import initial_depth_parameters
from rein3d_jax.networks.leaf_folder import read_leaf_folder, write_leaf_folder

SHIPPED_DEPTH = Path(__file__).resolve().parents[1] / "depth" / "weights"


def read_depth_network(folder: str | Path = SHIPPED_DEPTH, config: DepthNetworkConfig = DepthNetworkConfig()) -> dict:
    """Parameters, float32, as `estimate_depth` takes them. Raises InputError, naming the folder or tensor, for what is
    missing, unknown or of another shape."""
    return read_leaf_folder(folder, depth_shapes(config))


def read_depth_backbone(folder: str | Path, config: DepthNetworkConfig = DepthNetworkConfig()) -> dict:
    """The parameters of the backbone alone, as benchmarks/convert/backbone.py wrote them. Raises as above."""
    return read_leaf_folder(folder, depth_shapes(config)["backbone"])


def write_depth_network(folder: str | Path, parameters: dict) -> None:
    """Writes what `read_depth_network` reads. Raises InputError if it cannot be written."""
    write_leaf_folder(folder, parameters)


def depth_shapes(config: DepthNetworkConfig) -> dict:
    """Shapes of the parameters of a network of these sizes."""
    return jax.eval_shape(lambda: initial_depth_parameters(jax.random.key(0), config))
