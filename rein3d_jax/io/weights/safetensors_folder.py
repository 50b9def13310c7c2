"""Parameters from and to folders of safetensors files, whole or in shards, one leaf at a time.

Which tensor is which leaf says a name table (restore/wan/names.py), rows of `leaf`, `index`, `name`, `shape`, `axes`:
leaf[index] = tensor.transpose(axes).reshape(its shape). Only safetensors are read: other checkpoints hold code.
"""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from safetensors.numpy import save_file

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path, write_text
from rein3d_jax.io.files.json_file import path_within, read_json
from rein3d_jax.io.weights.tensor_file import FLOAT_8, FLOATS, SCALED_MARK, TensorFile, companions, scale_names

_STEM = "diffusion_pytorch_model"  # the file name of both layouts
_SHARD = 4 * 2**30  # bytes
_NAMED = 10  # faults that an error names; the others it counts


class Row(Protocol):
    """A row of the table: which tensor is (part of) which leaf, and how."""

    leaf: tuple[str, ...]
    index: int | None
    name: str
    shape: tuple[int, ...]
    axes: tuple[int, ...]


Changes = Mapping[str, Callable[[], np.ndarray]]  # by tensor, what is added to it, of its shape


def tensor_names(folder: str | Path) -> frozenset[str]:
    """All tensors of `folder`. Raises InputError if it holds no readable safetensors files."""
    with _opened(Path(folder)) as tensors:
        return frozenset(tensors)


def require_tensors(folder: str | Path, rows: Sequence[Row]) -> None:
    """Raises InputError as `load_params` does, without reading more than the files' headers."""
    with _opened(Path(folder)) as tensors:
        _check_fit(folder, rows, tensors)


def load_params(folder: str | Path, rows: Sequence[Row], like: Any, *, changes: Changes | None = None) -> Any:
    """The parameters `like` (nested dicts of jax.ShapeDtypeStruct) filled from `folder`, cast to its types.

    Each tensor is accounted for: InputError names those that lack, that no row knows, that have another shape or are
    no floats. On the host there is never more than one leaf.
    """
    folder, changes = Path(folder), changes or {}
    with _opened(folder) as tensors:
        _check_fit(folder, rows, tensors)
        table = _by_leaf(rows)
        return jax.tree_util.tree_map_with_path(
            lambda path, leaf: jnp.asarray(_read_leaf(tensors, table[_keys(path)], leaf, changes)), like
        )


def save_params(folder: str | Path, rows: Sequence[Row], params: Any, *, shard: int = _SHARD) -> None:
    """Writes `params` under the names of `rows`: one file, or, above `shard` bytes, several and their index.

    Each file appears whole or not at all, the index last. Raises InputError if a file cannot be written.
    """
    leaves = {_keys(path): leaf for path, leaf in jax.tree_util.tree_leaves_with_path(params)}
    assert _by_leaf(rows).keys() == leaves.keys(), "the table and the parameters differ"
    shards = list(_shards(rows, leaves, shard))
    weight_map = {}
    for number, part in enumerate(shards, 1):
        name = f"{_STEM}.safetensors" if len(shards) == 1 else f"{_STEM}-{number:05}-of-{len(shards):05}.safetensors"
        tensors = {row.name: _tensor(row, leaves[row.leaf]) for row in part}
        weight_map |= dict.fromkeys(tensors, name)
        with atomic_path(Path(folder) / name) as temporary:
            save_file(tensors, temporary)
    if len(shards) > 1:
        total = sum(_size(row, leaves) for row in rows)
        index = {"metadata": {"total_size": total}, "weight_map": weight_map}
        write_text(Path(folder) / f"{_STEM}.safetensors.index.json", json.dumps(index, indent=1))


@contextmanager
def _opened(folder: Path) -> Iterator[Mapping[str, TensorFile]]:
    """Name -> the open file that holds the tensor."""
    with ExitStack() as stack:
        tensors: dict[str, TensorFile] = {}
        for file in [TensorFile(stack, path) for path in _files(folder)]:
            for name in file.names:
                if name in tensors:
                    both = f"{tensors[name].path.name} and {file.path.name}"
                    raise InputError(f"{folder}: {both} both hold {name}: leave one model in the folder")
                tensors[name] = file
        yield tensors


def _files(folder: Path) -> list[Path]:
    """The files an index names, or else all of the folder."""
    if not folder.is_dir():
        raise InputError(f"{folder} is no folder: give the folder of the .safetensors files")
    indices = sorted(folder.glob("*.safetensors.index.json"))
    if len(indices) > 1:
        raise InputError(f"{folder} has {len(indices)} index files: leave one model in the folder")
    if not indices:
        files = sorted(folder.glob("*.safetensors"))
        if not files:
            raise InputError(f"{folder} has no .safetensors file: convert the checkpoint to safetensors first")
        return files
    weight_map = read_json(indices[0])
    weight_map = weight_map.get("weight_map") if isinstance(weight_map, dict) else None
    if not isinstance(weight_map, dict) or not all(isinstance(name, str) for name in weight_map.values()):
        raise InputError(f"{indices[0]} has no weight_map from tensors to files: copy it again")
    return [path_within(folder, name, named_by=indices[0]) for name in sorted(set(weight_map.values()))]


def _check_fit(folder, rows, tensors):
    known = {row.name for row in rows}
    for row in rows:
        if row.name in tensors and tensors[row.name].kind(row.name) in FLOAT_8:
            known |= {SCALED_MARK, *companions(row.name)}
    faults = [f"lacks {row.name} {row.shape}" for row in rows if row.name not in tensors]
    faults += [f"has {name}, which is unknown" for name in sorted(tensors.keys() - known)]
    faults += [fault for row in rows if row.name in tensors for fault in _row_faults(row, tensors)]
    if faults:
        more = f"; and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        raise InputError(f"{folder} {'; '.join(faults[:_NAMED])}{more}: choose the sizes that it was made for")


def _row_faults(row, tensors) -> Iterator[str]:
    shape, kind = tensors[row.name].shape(row.name), tensors[row.name].kind(row.name)
    if shape != row.shape:
        yield f"has {row.name} {shape}, not {row.shape}"
    elif kind not in FLOATS:
        yield f"has {row.name} as {kind}, not one of {', '.join(FLOATS)}"
    elif kind in FLOAT_8:
        scale = _scale_name(row, tensors)
        if scale is None and SCALED_MARK in tensors:
            yield f"lacks {scale_names(row.name)[0]}, though it has {SCALED_MARK}"
        elif scale and np.prod(sized := tensors[scale].shape(scale)) not in (1, row.shape[0]):
            yield f"has {scale} {sized}, neither one number nor one a row"


def _scale_name(row, tensors) -> str | None:
    return next((name for name in scale_names(row.name) if name in tensors), None)


def _read_leaf(tensors, rows, leaf, changes):
    out = np.empty(leaf.shape, leaf.dtype)
    for row in rows:
        tensor = _unscaled(row, tensors)
        if row.name in changes:
            tensor = tensor.astype(np.float32) + changes[row.name]()
        place = out if row.index is None else out[row.index]
        place[...] = tensor.transpose(row.axes).reshape(place.shape)
    return out


def _unscaled(row, tensors) -> np.ndarray:
    """The tensor's own numbers: 8-bit floats in float32, times their scale."""
    tensor, file = tensors[row.name].read(row.name), tensors[row.name]
    if file.kind(row.name) not in FLOAT_8:
        return tensor
    scale = _scale_name(row, tensors)
    factor = np.float32(1) if scale is None else tensors[scale].read(scale).astype(np.float32)
    return tensor.astype(np.float32) * np.reshape(factor, (-1,) + (1,) * (tensor.ndim - 1))


def _tensor(row, leaf):
    """The inverse of what a row says."""
    part = np.asarray(leaf if row.index is None else leaf[row.index])
    part = part.reshape([row.shape[axis] for axis in row.axes])
    return np.ascontiguousarray(part.transpose(np.argsort(row.axes)))


def _shards(rows, leaves, limit):
    part, size = [], 0
    for row in rows:
        if part and size + _size(row, leaves) > limit:
            yield part
            part, size = [], 0
        part.append(row)
        size += _size(row, leaves)
    yield part


def _size(row, leaves):
    return int(np.prod(row.shape)) * leaves[row.leaf].dtype.itemsize


def _by_leaf(rows) -> dict[tuple[str, ...], list[Row]]:
    table = {}
    for row in rows:
        table.setdefault(row.leaf, []).append(row)
    return table


def _keys(path):
    return tuple(key.key for key in path)
