"""Parameters from and to folders of safetensors files, whole or in shards, one leaf at a time.

Which tensor is which leaf says a name table (restore/wan/names.py), rows of `leaf`, `index`, `name`, `shape`, `axes`:
leaf[index] = tensor.transpose(axes).reshape(its shape). Only safetensors are read: other checkpoints hold code.
"""

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any, Protocol

import jax
import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save_file

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import atomic_path, write_text
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.files.json_file import path_within, read_json

_STEM = "diffusion_pytorch_model"  # the file name of both layouts
_FLOATS = {"F64", "F32", "F16", "BF16"}
_SHARD = 4 * 2**30  # bytes
_NAMED = 10  # faults that an error names; the others it counts


class Row(Protocol):
    """A row of the table: which tensor is (part of) which leaf, and how."""

    leaf: tuple[str, ...]
    index: int | None
    name: str
    shape: tuple[int, ...]
    axes: tuple[int, ...]


def tensor_names(folder: str | Path) -> frozenset[str]:
    """All tensors of `folder`. Raises InputError if it holds no readable safetensors files."""
    with _opened(Path(folder)) as tensors:
        return frozenset(tensors)


def load_params(folder: str | Path, rows: Sequence[Row], like: Any) -> Any:
    """The parameters `like` (nested dicts of jax.ShapeDtypeStruct) filled from `folder`, cast to its types.

    Each tensor is accounted for: InputError names those that lack, that no row knows, that have another shape or are
    no floats. On the host there is never more than one leaf.
    """
    folder = Path(folder)
    with _opened(folder) as tensors:
        _check_fit(folder, rows, tensors)
        table = _by_leaf(rows)
        return jax.tree_util.tree_map_with_path(
            lambda path, leaf: jnp.asarray(_read_leaf(folder, tensors, table[_keys(path)], leaf)), like
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
def _opened(folder: Path) -> Iterator[Mapping[str, Any]]:
    """Name -> the open file that holds the tensor."""
    with ExitStack() as stack:
        yield {name: file for path in _files(folder) for file in [_open(stack, path)] for name in _names(file)}


def _names(file) -> Iterable[str]:
    return file.keys()


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


def _open(stack: ExitStack, path: Path):
    require_file(path)
    try:
        return stack.enter_context(safe_open(path, framework="numpy"))
    except (SafetensorError, OSError) as error:
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is damaged or no safetensors file ({reason}): copy it again") from error


def _check_fit(folder, rows, tensors):
    names = {row.name for row in rows}
    faults = [f"lacks {row.name} {row.shape}" for row in rows if row.name not in tensors]
    faults += [f"has {name}, which is unknown" for name in sorted(tensors.keys() - names)]
    for row in rows:
        if row.name in tensors:
            view = tensors[row.name].get_slice(row.name)
            if tuple(view.get_shape()) != row.shape:
                faults.append(f"has {row.name} {tuple(view.get_shape())}, not {row.shape}")
            elif view.get_dtype() not in _FLOATS:
                faults.append(f"has {row.name} as {view.get_dtype()}, not one of {', '.join(sorted(_FLOATS))}")
    if faults:
        more = f"; and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        raise InputError(f"{folder} {'; '.join(faults[:_NAMED])}{more}: choose the sizes that it was made for")


def _read_leaf(folder, tensors, rows, leaf):
    out = np.empty(leaf.shape, leaf.dtype)
    for row in rows:
        try:
            tensor = tensors[row.name].get_tensor(row.name)
        except (SafetensorError, OSError) as error:
            raise InputError(f"{folder}: {row.name} cannot be read ({error}): copy the files again") from error
        place = out if row.index is None else out[row.index]
        place[...] = tensor.transpose(row.axes).reshape(place.shape)
    return out


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
