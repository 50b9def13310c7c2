"""The tensors of a LoRA's file: small beside the network's, so that they are read at once."""

from contextlib import ExitStack
from pathlib import Path

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.tensor_file import FLOATS, TensorFile


def read_lora_file(path: str | Path) -> dict[str, np.ndarray]:
    """All tensors, by name, in their stored types. Raises InputError for no safetensors file, or one of other numbers
    than floats."""
    with ExitStack() as stack:
        file = TensorFile(stack, Path(path))
        others = [f"{name} as {file.kind(name)}" for name in file.names if file.kind(name) not in FLOATS]
        if others:
            raise InputError(f"has {', '.join(others)}, not one of {', '.join(FLOATS)}")
        return {name: file.read(name) for name in file.names}
