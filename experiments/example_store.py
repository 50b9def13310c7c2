"""Training examples in a folder, one memory-mapped array a field: made once, since tracing, rendering and filling a
frame cost more than a step of training on it. A folder that is being written is read as far as it goes.

    FIELD.npy    (capacity, t, ...) uint8 colours and alpha, float16 metres, float32 positions
    count.json   {"done": how many examples are whole}
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.loss import Example

COUNT = "count.json"


def fields(frames: int, height: int) -> dict[str, tuple[tuple[int, ...], type]]:
    """Shape of each array for one example, and its stored type."""
    picture = (frames, height, 2 * height)
    return {
        "rgb": ((*picture, 3), np.uint8),
        "alpha": (picture, np.uint8),
        "distance": (picture, np.float16),
        "fill_rgb": ((*picture, CANDIDATES, 3), np.uint8),
        "fill_distance": ((*picture, CANDIDATES), np.float16),
        "position": ((frames, 3), np.float32),
        "clean_rgb": ((*picture, 3), np.uint8),
        "clean_distance": (picture, np.float16),
    }


class ExampleStore:
    """Examples read by number. Raises InputError where the folder holds none."""

    def __init__(self, folder: str | Path):
        self.folder = Path(folder)
        self.arrays = {name: self._open(name) for name in fields(1, 1)}
        self._open_fractions: list[float] = []

    def __len__(self) -> int:
        """Examples that are whole by now."""
        try:
            return int(json.loads((self.folder / COUNT).read_text())["done"])
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{self.folder / COUNT} cannot be read: {_MAKE}") from error

    def example(self, index: int, frames: np.ndarray | slice = slice(None)) -> Example:
        """Example `index`, or some of its frames, as float32."""
        parts = {name: _floats(array[index][frames]) for name, array in self.arrays.items()}
        clean = {name: parts.pop(name) for name in ("clean_rgb", "clean_distance")}
        return Example(Clip(**parts), **clean)

    def open_fractions(self, count: int) -> np.ndarray:
        """Share (count,) of each example's pixels that is a hole, on every 4th pixel."""
        for index in range(len(self._open_fractions), count):
            self._open_fractions.append(float((self.arrays["alpha"][index, 1:, ::4, ::4] < 128).mean()))
        return np.array(self._open_fractions[:count])

    @property
    def frames(self) -> int:
        """Frames of each example, the anchor among them."""
        return self.arrays["alpha"].shape[1]

    def _open(self, name: str) -> np.ndarray:
        try:
            return np.load(self.folder / f"{name}.npy", mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise InputError(f"{self.folder / name}.npy cannot be read: {_MAKE}") from error


def write_examples(folder: str | Path, example: Callable[[int], Example], count: int) -> Iterator[int]:
    """Numbers of whole examples, after each that is stored, of examples 0 to count - 1, all of one shape. Killed and
    begun again, it goes on. Raises InputError where the folder holds examples of another count or shape."""
    folder, arrays = Path(folder), {}
    folder.mkdir(parents=True, exist_ok=True)
    for index in range(_done(folder, count), count):
        made = example(index)
        parts = {**vars(made.clip), "clean_rgb": made.clean_rgb, "clean_distance": made.clean_distance}
        arrays = arrays or _arrays(folder, count, fields(*np.shape(made.clip.alpha)[:2]), new=index == 0)
        for name, array in arrays.items():
            array[index] = _stored(np.asarray(parts[name]), array.dtype)
        write_text(folder / COUNT, json.dumps({"done": index + 1}))
        yield index + 1


def _done(folder: Path, count: int) -> int:
    """Examples that an earlier run left whole in a folder for `count` of them."""
    if not (folder / COUNT).exists():
        return 0
    store = ExampleStore(folder)
    if (room := len(store.arrays["alpha"])) != count:
        raise InputError(f"{folder} is a folder for {room} examples, not {count}: choose an empty output")
    return len(store)


def _arrays(folder: Path, count: int, shapes: dict, *, new: bool) -> dict[str, np.ndarray]:
    arrays = {}
    for name, (shape, dtype) in shapes.items():
        path, whole = folder / f"{name}.npy", (count, *shape)
        options = {"mode": "w+", "dtype": dtype, "shape": whole} if new else {"mode": "r+"}
        arrays[name] = np.lib.format.open_memmap(path, **options)
        if arrays[name].shape != whole:
            raise InputError(f"{path} is of {arrays[name].shape}, not {whole}: choose an empty output")
    return arrays


def _stored(array: np.ndarray, dtype: np.dtype) -> np.ndarray:
    return np.round(np.clip(array, 0, 1) * 255).astype(dtype) if dtype == np.uint8 else array.astype(dtype)


def _floats(array: np.ndarray) -> np.ndarray:
    return array.astype(np.float32) / 255 if array.dtype == np.uint8 else array.astype(np.float32)


_MAKE = "make it by `python -m experiments.build_examples --config experiments/recipes/tiny_examples.toml`"
