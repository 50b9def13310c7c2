"""What restoring a clip with the full-size network costs, foreseen without running or allocating anything.

Operations are those of matrix products and convolutions, two a multiply-add, counted in the traced program. XLA's own
account of a compiled pass is 1 % above, for it has elementwise work too; of the VAE, whose padding of zeros it leaves
out, 10 % below (test_wan_cost.py).
"""

import math
from dataclasses import dataclass, replace
from functools import cache, partial

import jax
import jax.numpy as jnp

from rein3d_jax.restore.wan.config import DitConfig, VaeConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.restore import DiffusionConfig
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes
from rein3d_jax.restore.wan.vae import LATENT, Vae
from rein3d_jax.restore.wan.windows import latent_length, padded_length, window_starts

_TERA = 1e12
_TEXT = 512  # tokens of an embedded prompt
# Makers' dense bfloat16 peaks in TFLOP/s, and the share of it that an H100 reached (benchmarks/results/gpu.json: 41
# frames of 448 x 896 in bfloat16, attention by cuDNN); that other devices reach as much is assumed.
_PEAKS = {"A100": 312.0, "H100": 989.0, "H200": 989.0, "B200": 2250.0, "TPU v5e": 197.0, "TPU v5p": 459.0}
_TRANSFORMER, _VAE = 0.54, 0.30
_CPU_CORE = 0.1  # TFLOP/s that one core of a 2.5 GHz Xeon reaches in a block of the full width, float32 or bfloat16


@dataclass(frozen=True)
class ClipCost:
    """Operations of one clip, all its windows together."""

    passes: int  # of the transformer
    transformer: float  # operations of them all
    vae: float  # operations of encoding what is given, and of decoding

    @property
    def total(self) -> float:
        """Operations."""
        return self.transformer + self.vae


def clip_cost(config: DiffusionConfig, frames: int, height: int, width: int) -> ClipCost:
    """The cost of a clip of so many frames and pixels."""
    network, sample = config.network, config.sample
    windows = len(window_starts(padded_length(frames), sample.windows))
    length = min(padded_length(frames), sample.windows.frames)
    passes = windows * sample.steps * (1 if sample.guidance == 1 else 2)
    rows, columns = height // network.vae.stride, width // network.vae.stride
    one = pass_flops(network.dit, (1 + latent_length(length), rows, columns), _TEXT if sample.words else 1)
    encode = partial(vae_flops, network.vae, height=height, width=width, decode=False)
    decoded = vae_flops(network.vae, length, height, width, decode=True)
    return ClipCost(passes, passes * one, windows * (2 * encode(length) + encode(1) + decoded))


def seconds_by_device(cost: ClipCost) -> dict[str, float]:
    """Seconds that a clip takes on one device of each class."""
    full = (cost.transformer / _TRANSFORMER + cost.vae / _VAE) / _TERA
    return {name: full / peak for name, peak in _PEAKS.items()} | {"CPU core": cost.total / _TERA / _CPU_CORE}


@cache
def pass_flops(config: DitConfig, latents: tuple[int, int, int], text: int) -> float:
    """Operations of one pass over latents (t, h, w), its text of so many tokens."""
    config = replace(config, kernel="xla", remat=False)  # the same products, none of them hidden or padded
    given = [jax.ShapeDtypeStruct((1, *latents, config.channels), jnp.float32), jax.ShapeDtypeStruct((1,), jnp.float32)]
    given.append(jax.ShapeDtypeStruct((1, text, config.text_dim), jnp.float32))
    if config.control_every:
        given.append(jax.ShapeDtypeStruct((1, *latents, config.control_channels), jnp.float32))
    return program_flops(Dit(config).apply, {"params": dit_shapes(config)}, *given)


@cache
def vae_flops(config: VaeConfig, frames: int, height: int, width: int, *, decode: bool) -> float:
    """Operations of encoding or decoding a video of so many frames and pixels."""
    video = jax.ShapeDtypeStruct((1, frames, height, width, 3), jnp.float32)
    size = (1, latent_length(frames), height // config.stride, width // config.stride, LATENT)
    given = jax.ShapeDtypeStruct(size, jnp.float32) if decode else video
    apply = partial(Vae(config).apply, method="decode" if decode else "encode")
    return program_flops(apply, {"params": vae_shapes(config)}, given)


def program_flops(function, *given) -> float:
    """Operations of a program's matrix products and convolutions, loops counted as often as they run."""
    return _counted(jax.make_jaxpr(function)(*given).jaxpr)


def _counted(jaxpr) -> float:
    total = 0.0
    for equation in jaxpr.eqns:
        kind, params = equation.primitive.name, equation.params
        if kind in ("dot_general", "conv_general_dilated"):
            total += 2.0 * math.prod(equation.outvars[0].aval.shape) * _summed(equation)
        assert kind != "while", "a loop of unknown length"
        inner = sum(_counted(part) for part in map(_jaxpr, params.values()) if part is not None)
        total += inner * (params["length"] if kind == "scan" else 1)
    return total


def _summed(equation) -> int:
    """Products that each number of the result is the sum of."""
    params, right = equation.params, equation.invars[1].aval.shape
    if "dimension_numbers" in params and equation.primitive.name == "dot_general":
        (_, axes), _ = params["dimension_numbers"]
        return math.prod(right[axis] for axis in axes)
    outputs = params["dimension_numbers"].rhs_spec[0]
    return math.prod(right) // right[outputs]


def _jaxpr(value):
    """The program inside an equation's parameter, if it is one."""
    inner = getattr(value, "jaxpr", value)
    return inner if hasattr(inner, "eqns") else None
