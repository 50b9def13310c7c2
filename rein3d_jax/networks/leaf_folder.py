"""A network's parameters in a folder of safetensors: a tensor a leaf, named by its path, as float16."""

from pathlib import Path
from typing import Any

import jax
import numpy as np

from rein3d_jax.io.weights.safetensors_folder import load_params, save_params
from rein3d_jax.restore.wan.names import TensorRow


def read_leaf_folder(folder: str | Path, shapes: dict) -> dict:
    """Parameters, float32, of these shapes. Raises InputError, naming the folder or tensor, for what is missing,
    unknown or of another shape."""
    return load_params(folder, _rows(shapes), shapes)


def write_leaf_folder(folder: str | Path, parameters: dict) -> None:
    """Writes what `read_leaf_folder` reads. Raises InputError if it cannot be written."""
    half = jax.tree.map(lambda leaf: np.asarray(leaf, np.float16), parameters)
    save_params(folder, _rows(half), half)


def _rows(tree: Any) -> list[TensorRow]:
    leaves = [(tuple(key.key for key in path), leaf) for path, leaf in jax.tree_util.tree_leaves_with_path(tree)]
    return [TensorRow(path, None, ".".join(path), leaf.shape, tuple(range(leaf.ndim))) for path, leaf in leaves]
