"""The name table: which tensor of a published checkpoint is which leaf of our parameters, for both layouts.

"wan" are the original names of Wan2.1 and VACE, "diffusers" those of that library's folders. Pure: shapes in, rows out;
io/safetensors_folder.py moves the bytes. Facts: diffusers 0.42.1, loaders/single_file_utils.py and its models.
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import DitConfig, VaeConfig

LAYOUTS = ("diffusers", "wan")


@dataclass(frozen=True)
class TensorRow:
    """leaf[index] = tensor.transpose(axes).reshape(its shape)"""

    leaf: tuple[str, ...]  # keys into the parameters
    index: int | None  # along the leaf's first axis, where blocks are stacked
    name: str  # of the tensor in the checkpoint
    shape: tuple[int, ...]  # of the tensor
    axes: tuple[int, ...]


# Ours -> (diffusers, wan). The two libraries call the norm before the text's attention norm2 and norm3.
_DIT = {
    "embed": ("patch_embedding", "patch_embedding"),
    "control_embed": ("vace_patch_embedding", "vace_patch_embedding"),
    "control_in": ("vace_blocks.0.proj_in", "vace_blocks.0.before_proj"),
    "time_in": ("condition_embedder.time_embedder.linear_1", "time_embedding.0"),
    "time_out": ("condition_embedder.time_embedder.linear_2", "time_embedding.2"),
    "time_modulation": ("condition_embedder.time_proj", "time_projection.1"),
    "text_in": ("condition_embedder.text_embedder.linear_1", "text_embedding.0"),
    "text_out": ("condition_embedder.text_embedder.linear_2", "text_embedding.2"),
    "modulation": ("scale_shift_table", "head.modulation"),
    "head": ("proj_out", "head.head"),
}
_BLOCK = {
    "modulation": ("scale_shift_table", "modulation"),
    "self_attention": ("attn1", "self_attn"),
    "text_attention": ("attn2", "cross_attn"),
    "query": ("to_q", "q"),
    "key": ("to_k", "k"),
    "value": ("to_v", "v"),
    "out": ("to_out.0", "o"),
    "query_norm": ("norm_q.weight", "norm_q.weight"),
    "key_norm": ("norm_k.weight", "norm_k.weight"),
    "text_norm": ("norm2", "norm3"),
    "ffn_in": ("ffn.net.0.proj", "ffn.0"),
    "ffn_out": ("ffn.net.2", "ffn.2"),
    "hint": ("proj_out", "after_proj"),
}
_VAE = {
    "quant": ("quant_conv", "conv1"),
    "post_quant": ("post_quant_conv", "conv2"),
    "in": ("conv_in", "conv1"),
    "out": ("conv_out", "head.2"),
    "norm": ("norm_out", "head.0"),
    "middle_0": ("mid_block.resnets.0", "middle.0"),
    "middle_1": ("mid_block.attentions.0", "middle.1"),
    "middle_2": ("mid_block.resnets.1", "middle.2"),
}
_VAE_LAYER = {
    "norm_1": ("norm1", "residual.0"),
    "convolution_1": ("conv1", "residual.2"),
    "norm_2": ("norm2", "residual.3"),
    "convolution_2": ("conv2", "residual.6"),
    "shortcut": ("conv_shortcut", "shortcut"),
    "space": ("resample.1", "resample.1"),
    "time": ("time_conv", "time_conv"),
    "norm": ("norm", "norm"),
    "query_key_value": ("to_qkv", "to_qkv"),
    "projection": ("proj", "proj"),
}
_ENDINGS = {"kernel": "weight", "scale": "weight", "bias": "bias"}


def dit_rows(shapes: Mapping, config: DitConfig, layout: str) -> tuple[TensorRow, ...]:
    """A row for each tensor of `layout` behind the parameters of `Dit`; `shapes` are those parameters, as arrays or
    jax.ShapeDtypeStruct."""
    column = LAYOUTS.index(layout)
    rows = []
    for leaf, shape in _leaves(shapes):
        if leaf[0] != "steps":
            tail = [_DIT[leaf[0]][column], *(_ENDINGS[key] for key in leaf[1:])]
            rows.append(TensorRow(leaf, None, ".".join(tail), *_linear(leaf, shape, config)))
            continue
        tail = ".".join(_BLOCK[key][column] if key in _BLOCK else _ENDINGS[key] for key in leaf[2:])
        for step in range(shape[0]):
            place = f"vace_blocks.{step}"
            if leaf[1].startswith("block_"):
                place = f"blocks.{step * config.group + int(leaf[1].removeprefix('block_'))}"
            elif leaf[1] == "hint":
                tail = f"{_BLOCK['hint'][column]}.{_ENDINGS[leaf[2]]}"
            rows.append(TensorRow(leaf, step, f"{place}.{tail}", *_linear(leaf, shape[1:], config)))
    return tuple(rows)


def vae_rows(shapes: Mapping, config: VaeConfig, layout: str) -> tuple[TensorRow, ...]:
    """As `dit_rows`, for the parameters of `Vae`."""
    return tuple(
        TensorRow(leaf, None, _vae_name(leaf, config, LAYOUTS.index(layout)), *_convolution(leaf, shape))
        for leaf, shape in _leaves(shapes)
    )


def _leaves(shapes) -> Iterator[tuple[tuple[str, ...], tuple[int, ...]]]:
    for path, leaf in jax.tree_util.tree_leaves_with_path(shapes):
        yield tuple(key.key for key in path), tuple(leaf.shape)


def _linear(leaf, shape, config):
    """The tensor's shape and the axes that make it ours: a kernel is transposed, an embedding's unfolded."""
    if leaf[0] in ("embed", "control_embed") and leaf[-1] == "kernel":
        return (shape[1], shape[0] // math.prod(config.patch), *config.patch), (1, 2, 3, 4, 0)
    if leaf[-1] == "kernel":
        return shape[::-1], (1, 0)
    return ((1, *shape), (0, 1, 2)) if leaf[-1] == "modulation" else (shape, (0,))


def _convolution(leaf, shape):
    flat = 2 if "middle_1" in leaf else 3  # the attention is made of 2D convolutions, all else of 3D
    if leaf[-1] == "scale":
        return (*shape, *(1,) * flat), tuple(range(1 + flat))
    if leaf[-1] == "bias":
        return shape, (0,)
    window = shape[:-2]  # empty where we multiply by a matrix and they convolve with one pixel
    tensor = (shape[-1], shape[-2], *(window or (1,) * flat))
    return tensor, (*range(2, len(tensor)), 1, 0)


def _vae_name(leaf, config, column):
    """encoder/layer_3/shortcut/kernel -> encoder.down_blocks.3.conv_shortcut.weight"""
    half, *keys, last = (key for key in leaf if key != "convolution")
    ending = "gamma" if last == "scale" else _ENDINGS[last]
    if half not in ("encoder", "decoder"):
        return f"{_VAE[half][column]}.{ending}"
    first, *rest = keys
    place = _layer(half, int(first.removeprefix("layer_")), config) if first.startswith("layer_") else _VAE[first]
    return ".".join([half, place[column], *(_VAE_LAYER[key][column] for key in rest), ending])


def _layer(half, layer, config):
    if half == "encoder":
        return f"down_blocks.{layer}", f"downsamples.{layer}"
    stage, within = divmod(layer, config.blocks + 2)
    inner = f"resnets.{within}" if within <= config.blocks else "upsamplers.0"
    return f"up_blocks.{stage}.{inner}", f"upsamples.{layer}"


def layout_of(names: Iterable[str]) -> str:
    """The layout whose mark `names`, all tensors of a checkpoint, bear. Raises InputError if they bear none."""
    marks = {"scale_shift_table": "diffusers", "quant_conv.weight": "diffusers", "head.modulation": "wan"}
    marks["conv2.weight"] = "wan"  # of the VAE, at its decoder's entrance
    for name in names:
        if name in marks:
            return marks[name]
    raise InputError("the checkpoint is neither a Wan transformer nor its VAE: give the folder of one of the two")
