"""A torch checkpoint as a folder of float16 safetensors, as the project's reader of folders names files. Needs torch
and safetensors, and nothing of this project."""

import argparse
from collections.abc import Callable
from pathlib import Path

import numpy as np

Arrays = dict[str, np.ndarray]


def convert_checkpoint(name: str, purpose: str, leaves: Callable[[Arrays], Arrays], arguments: list[str] | None) -> int:
    """The command `python -m benchmarks.convert.NAME CHECKPOINT FOLDER`: writes the `leaves` of the checkpoint's
    tensors, float64, those under "params" where it has that key."""
    prog, description = f"python -m benchmarks.convert.{name}", purpose.partition("\n")[0]
    parser = argparse.ArgumentParser(prog=prog, description=description)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("folder", type=Path)
    options = parser.parse_args(arguments)
    import torch
    from safetensors.numpy import save_file

    options.folder.mkdir(parents=True, exist_ok=True)
    state = torch.load(options.checkpoint, weights_only=True)
    tensors = state.get("params", state)
    arrays = leaves({key: tensor.double().numpy() for key, tensor in tensors.items()})
    half = {leaf: np.ascontiguousarray(array, np.float16) for leaf, array in arrays.items()}
    save_file(half, options.folder / "diffusion_pytorch_model.safetensors")
    return 0
