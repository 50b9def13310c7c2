"""The learned restorer's weights: one NPZ file, never unpickled; arrays as float16, named by their path in the
parameters, and the network's sizes as JSON text."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path
from rein3d_jax.io.files.npy import read_arrays, read_headers

SHIPPED_RESTORER = Path(__file__).resolve().parents[2] / "restore" / "weights" / "restorer.npz"
SIZES_NAME = "network.json"  # the name of the text among the arrays


def write_restorer(path: str | Path, parameters: dict, sizes: dict[str, int]) -> None:
    """Writes nested dicts of arrays and the network's sizes, atomically. Raises InputError."""
    arrays = {name: np.asarray(leaf, np.float16) for name, leaf in _flat(parameters)}
    text = np.frombuffer(json.dumps(sizes).encode(), np.uint8)
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        np.savez_compressed(file, allow_pickle=False, **{SIZES_NAME: text}, **arrays)


def read_restorer(path: str | Path = SHIPPED_RESTORER) -> tuple[dict, dict[str, int]]:
    """Parameters as nested dicts of float32 arrays, and the network's sizes. Raises InputError if the file is missing
    or damaged, or is something else."""
    path = Path(path)
    if not path.exists():
        raise InputError(
            f"{path} is missing: give restore.weights the weights.npz of a training run "
            '(python -m experiments.train_restore), or set restore.method = "background"'
        )
    names = list(read_headers(path))
    arrays = dict(zip(names, read_arrays(path, names), strict=True))
    try:
        sizes = json.loads(arrays.pop(SIZES_NAME).tobytes())
        return _nested(arrays), {str(name): int(size) for name, size in sizes.items()}
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise InputError(f"{path} holds no restorer's weights: give restore.weights one of train_restore's") from error


def _flat(tree: dict, prefix: str = "") -> list[tuple[str, Any]]:
    pairs = []
    for name, value in tree.items():
        pairs += _flat(value, f"{prefix}{name}/") if isinstance(value, dict) else [(prefix + name, value)]
    return pairs


def _nested(arrays: dict[str, np.ndarray]) -> dict:
    tree: dict = {}
    for path, array in arrays.items():
        *folders, name = path.split("/")
        inner = tree
        for folder in folders:
            inner = inner.setdefault(folder, {})
        inner[name] = array.astype(np.float32)
    return tree
