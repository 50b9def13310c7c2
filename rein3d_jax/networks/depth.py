"""The distance network's weights in a folder of safetensors: a tensor a leaf, named by its path, as float16."""

from pathlib import Path
from typing import Any

import jax
import numpy as np

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.network import initial_depth_parameters
from rein3d_jax.io.weights.safetensors_folder import load_params, save_params
from rein3d_jax.restore.wan.names import TensorRow

SHIPPED_DEPTH = Path(__file__).resolve().parents[1] / "depth" / "weights"


def read_depth_network(folder: str | Path = SHIPPED_DEPTH, config: DepthNetworkConfig = DepthNetworkConfig()) -> dict:
    """Parameters, float32, as `estimate_depth` takes them. Raises InputError, naming the folder or tensor, for what is
    missing, unknown or of another shape."""
    return _read(folder, depth_shapes(config))


def read_depth_backbone(folder: str | Path, config: DepthNetworkConfig = DepthNetworkConfig()) -> dict:
    """The parameters of the backbone alone, as benchmarks/convert_backbone.py wrote them. Raises as above."""
    return _read(folder, depth_shapes(config)["backbone"])


def write_depth_network(folder: str | Path, parameters: dict) -> None:
    """Writes what `read_depth_network` reads. Raises InputError if it cannot be written."""
    half = jax.tree.map(lambda leaf: np.asarray(leaf, np.float16), parameters)
    save_params(folder, _rows(half), half)


def depth_shapes(config: DepthNetworkConfig) -> dict:
    """Shapes of the parameters of a network of these sizes."""
    return jax.eval_shape(lambda: initial_depth_parameters(jax.random.key(0), config))


def _read(folder: str | Path, shapes: dict) -> dict:
    return load_params(folder, _rows(shapes), shapes)


def _rows(tree: Any) -> list[TensorRow]:
    leaves = [(tuple(key.key for key in path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]
    return [TensorRow(path, None, ".".join(path), leaf.shape, tuple(range(leaf.ndim))) for path, leaf in leaves]
