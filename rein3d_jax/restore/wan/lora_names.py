"""LoRAs of others: which tensors of such a file change which tensor of the network, whoever trained it.

A change is low-rank, alpha / r x up x down with r rows in `down` (alpha = r where it is not said), or, for norms and
biases, whole (`diff`). Known are the names of peft and diffusers (lora_A, lora_B), of Wan's own modules and ComfyUI's
(diffusion_model. before them), and of kohya's trainers (lora_unet_, dots written as underscores). Facts: diffusers
0.42.1, loaders/lora_conversion_utils.py. Pure: names and arrays in, arrays out.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.names import TensorRow
from rein3d_jax.settings import Settings, setting

_PREFIXES = ("base_model.model.", "model.", "diffusion_model.", "transformer.", "lora_unet_")
_ROLES = {
    ".lora_A.weight": "down",
    ".lora_A.default.weight": "down",
    ".lora_down.weight": "down",
    ".lora_B.weight": "up",
    ".lora_B.default.weight": "up",
    ".lora_up.weight": "up",
    ".alpha": "alpha",
    ".diff": "whole",
    ".diff_b": "whole of bias",
}
_NAMED = 10  # faults that an error names; the others it counts


@dataclass(frozen=True)
class LoraFileConfig(Settings):
    """A LoRA that somebody trained for this network, merged into its weights when they are read."""

    file: str | None = setting(None, "safetensors of a LoRA; none: the weights as they are")
    scale: float = setting(1.0, "of what it changes", within="(-inf, inf)")


NameTables = Sequence[Sequence[TensorRow]]  # one network's tables under several layouts' names, in the same order
LoraParts = dict[str, np.ndarray]  # what changes one tensor, by role


def lora_parts(
    tensors: Mapping[str, np.ndarray], base: Sequence[TensorRow], layouts: NameTables
) -> dict[str, LoraParts]:
    """By tensor of `base` what changes it. Raises InputError that names each tensor of the LoRA that the network has
    no place for, that lacks its other half, or does not fit."""
    places, found, faults = _places(base, layouts), {}, []
    for name, array in tensors.items():
        module, role = _module_and_role(name)
        row = places.get((module, "bias" if role == "whole of bias" else "weight"))
        if row is None or not role:
            faults.append(f"has {name}, which is unknown")
        else:
            found.setdefault(row.name, {})[role.removesuffix(" of bias")] = array
    shapes = {row.name: row.shape for row in base}
    faults += [fault for name, parts in found.items() for fault in _faults(name, shapes[name], parts)]
    if faults:
        more = f"; and {len(faults) - _NAMED} more" if len(faults) > _NAMED else ""
        raise InputError(f"{'; '.join(faults[:_NAMED])}{more}: choose a LoRA of this network")
    return found


def lora_change(parts: LoraParts, shape: tuple[int, ...], scale: float) -> np.ndarray:
    """scale (alpha / r up down + whole), float32, of a tensor of `shape`."""
    change = np.zeros(shape, np.float32)
    if "down" in parts:
        rank = len(parts["down"])
        up, down = parts["up"].reshape(shape[0], rank), parts["down"].reshape(rank, -1)
        gain = np.asarray(parts.get("alpha", rank)).item() / rank
        change += gain * (up.astype(np.float32) @ down.astype(np.float32)).reshape(shape)
    if "whole" in parts:
        change += parts["whole"].astype(np.float32).reshape(shape)
    return np.float32(scale) * change


def _places(base: Sequence[TensorRow], layouts: NameTables) -> dict[tuple[str, str], TensorRow]:
    """(module, weight or bias) -> row of the base, by each of its names."""
    places = {}
    for row, *aliases in zip(base, *layouts, strict=True):
        for alias in aliases:
            module, _, kind = alias.name.rpartition(".")
            if kind in ("weight", "bias"):
                places |= {(module, kind): row, (module.replace(".", "_"), kind): row}
    return places


def _module_and_role(name: str) -> tuple[str, str]:
    """diffusion_model.blocks.0.ffn.0.lora_down.weight -> blocks.0.ffn.0, down; no role for what is none of a LoRA."""
    ending = next((ending for ending in sorted(_ROLES, key=len, reverse=True) if name.endswith(ending)), "")
    module = name.removesuffix(ending)
    for prefix in _PREFIXES:
        module = module.removeprefix(prefix)
    return module, _ROLES.get(ending, "")


def _faults(name: str, shape: tuple[int, ...], parts: LoraParts) -> Iterable[str]:
    if ("down" in parts) != ("up" in parts) or parts.keys() == {"alpha"}:
        yield f"has {' and '.join(parts)} alone for {name}"
    elif "down" in parts:
        up, down = parts["up"].shape, parts["down"].shape
        sizes = (up[0], down[0], int(np.prod(down[1:])))
        if sizes != (shape[0], int(np.prod(up[1:])), int(np.prod(shape[1:]))) or np.size(parts.get("alpha", 1)) != 1:
            yield f"has up {up} and down {down} for {name} {shape}"
    if "whole" in parts and parts["whole"].size != np.prod(shape):
        yield f"has a difference {parts['whole'].shape} for {name} {shape}"
