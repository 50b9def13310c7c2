"""Any pytree of arrays and words to one NPZ file and back; leaves are named by their jax.tree_util key paths."""

from pathlib import Path
from typing import Any

import jax
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path
from rein3d_jax.io.files.npy import read_arrays, read_headers


def save(path: str | Path, tree: Any) -> None:
    """Writes the arrays of `tree`, atomically; the same tree gives the same bytes. Leaves must be of NumPy's own
    types (key data, not typed keys). Raises InputError if the file cannot be written."""
    arrays = {name: np.asarray(leaf) for name, leaf in _named_leaves(tree).items()}
    for name, array in arrays.items():
        assert array.dtype.kind in "biufcU", f"{name} is {array.dtype}, which NPZ cannot hold"
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, allow_pickle=False, **arrays)


def load(path: str | Path, like: Any) -> Any:
    """The pytree in `path`, in the structure of `like` (arrays or jax.ShapeDtypeStruct). Shapes come from the file,
    dtypes must agree; leaves are jax arrays where `like` has none of NumPy's. Raises InputError if the file is
    missing or damaged, or its leaves are not those of `like`."""
    path, wanted = Path(path), _named_leaves(like)
    headers = read_headers(path)
    _check_fit(path, {name: header.dtype for name, header in headers.items()}, wanted)
    arrays = read_arrays(path, list(wanted))
    leaves = [_as(leaf, array) for leaf, array in zip(wanted.values(), arrays, strict=True)]
    return jax.tree.unflatten(jax.tree.structure(like), leaves)


def _as(leaf: Any, array: np.ndarray) -> Any:
    if isinstance(leaf, str):
        return str(array)
    return array if isinstance(leaf, np.ndarray | np.generic | int | float | complex) else jax.device_put(array)


def _named_leaves(tree: Any) -> dict[str, Any]:
    return {jax.tree_util.keystr(path): leaf for path, leaf in jax.tree_util.tree_leaves_with_path(tree)}


def _check_fit(path: Path, stored: dict[str, np.dtype], wanted: dict[str, Any]) -> None:
    dtypes = {name: np.dtype(getattr(leaf, "dtype", type(leaf))) for name, leaf in wanted.items()}
    stored = {name: np.dtype(str) if dtype.kind == "U" else dtype for name, dtype in stored.items()}
    faults = [f"lacks {name}" for name in dtypes.keys() - stored.keys()]
    faults += [f"has {name}, which is unknown" for name in stored.keys() - dtypes.keys()]
    both = dtypes.keys() & stored.keys()
    faults += [f"has {name} as {stored[name]}, not {dtypes[name]}" for name in both if stored[name] != dtypes[name]]
    if faults:
        raise InputError(f"{path} {'; '.join(sorted(faults))}: remove it and run that stage again")
