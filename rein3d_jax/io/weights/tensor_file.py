"""One safetensors file: names, shapes and numbers of its tensors, floats of 8 bits among them.

An 8-bit tensor may have a scale beside it, a number or one a row: tensor = stored x scale. ComfyUI and others name it
X.scale_weight or X.weight_scale, and write more that only their own arithmetic needs (`companions`).
"""

import json
from contextlib import ExitStack
from functools import cached_property
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from safetensors import SafetensorError, safe_open

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file

FLOAT_8 = {"F8_E4M3": jnp.float8_e4m3fn, "F8_E5M2": jnp.float8_e5m2}
_TYPES = {"BF16": jnp.bfloat16, "F16": jnp.float16, "F32": jnp.float32, "F64": np.float64, **FLOAT_8}
FLOATS = tuple(_TYPES)
SCALED_MARK = "scaled_fp8"  # a tensor of ComfyUI's files whose 8-bit tensors all have scales
_PREFIX = "model.diffusion_model."  # before all names where a whole ComfyUI checkpoint was saved
_SCALES = (".scale_weight", ".weight_scale")
_ONLY_THEIRS = (".scale_input", ".input_scale", ".comfy_quant")


class TensorFile:
    """An open file; `stack` closes it. Raises InputError for what is damaged or no safetensors."""

    def __init__(self, stack: ExitStack, path: Path):
        require_file(path)
        self.path = path
        try:
            self._file = stack.enter_context(safe_open(path, framework="numpy"))
        except (SafetensorError, OSError) as error:
            reason = " ".join(str(error).split())
            raise InputError(f"{path} is damaged or no safetensors file ({reason}): copy it again") from error
        stored = self._file.keys()
        self._stored = {name.removeprefix(_PREFIX): name for name in stored}

    @property
    def names(self) -> tuple[str, ...]:
        """Of the tensors."""
        return tuple(self._stored)

    def shape(self, name: str) -> tuple[int, ...]:
        """Of a tensor, which is not read."""
        return tuple(self._slice(name).get_shape())

    def kind(self, name: str) -> str:
        """Type of its numbers, as safetensors calls it."""
        return self._slice(name).get_dtype()

    def read(self, name: str) -> np.ndarray:
        """A tensor of FLOATS in its stored type. Raises InputError where it cannot be read."""
        try:
            return self._bytes(name).view(jnp.dtype(_TYPES[self.kind(name)])).reshape(self.shape(name))
        except (SafetensorError, OSError, ValueError) as error:
            raise InputError(f"{self.path}: {name} cannot be read ({error}): copy the file again") from error

    def _slice(self, name: str):
        return self._file.get_slice(self._stored[name])

    def _bytes(self, name: str) -> np.ndarray:
        """Read, and not mapped: pages of a mapped file count as the process's own beside what was made of them. And
        NumPy has no 8-bit floats, so that the library gives none."""
        begin, end = self._offsets[self._stored[name]]["data_offsets"]
        return np.fromfile(self.path, np.uint8, end - begin, offset=self._data + begin)

    @cached_property
    def _offsets(self) -> dict:
        with open(self.path, "rb") as file:
            return json.loads(file.read(self._data)[8:])

    @cached_property
    def _data(self) -> int:
        """Where the header ends, from which offsets count."""
        with open(self.path, "rb") as file:
            return 8 + int.from_bytes(file.read(8), "little")


def scale_names(name: str) -> tuple[str, ...]:
    """What the scale of the 8-bit tensor `name` may be called."""
    return tuple(name.removesuffix(".weight") + ending for ending in _SCALES)


def companions(name: str) -> tuple[str, ...]:
    """Names that may stand beside an 8-bit tensor: its scale, and what says nothing about its numbers."""
    return (*scale_names(name), *(name.removesuffix(".weight") + ending for ending in _ONLY_THEIRS))
