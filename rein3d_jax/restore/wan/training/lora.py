"""Low-rank adaptation (Hu et al. 2021): W' = W + gain A B for the kernels that are named; A and B alone are trained.

B starts at zero, so the adapted network starts as the base. The pairs live in a flat dict beside the parameters, and
merging them gives ordinary parameters, which are sampled and saved as any others. Training merges at each step, too:
there is one network for all, at the cost of a second copy of the named kernels and their gradient (memory.py counts
them).
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

_KERNELS = ("query", "key", "value", "out", "ffn_in", "ffn_out")


@dataclass(frozen=True)
class LoraConfig(Settings):
    """Low-rank adaptation of the transformer."""

    rank: int = setting(32, "of each pair", within="[1, inf)")
    gain: float = setting(1.0, "of the pairs' product over the kernel", within="(-inf, inf)")
    kernels: tuple[str, ...] = setting(_KERNELS, "names of those adapted, in each block of both branches")


@struct.dataclass
class LoraPair:
    """A kernel's low-rank change: down times up."""

    down: jax.Array  # (..., in, rank)
    up: jax.Array  # (..., rank, out)


def start_pairs(key: jax.Array, params: dict, config: LoraConfig) -> dict[str, LoraPair]:
    """Pairs of the kernels (..., in, out) named, by their paths. Raises InputError for a name that no kernel has."""
    leaves = leaves_by_path(params)
    unknown = set(config.kernels) - {_name(path) for path in leaves}
    if unknown:
        raise InputError(f"lora.kernels: the network has no {', '.join(sorted(unknown))}")
    named = [(path, leaf) for path, leaf in leaves.items() if _name(path) in config.kernels]
    keys = jax.random.split(key, len(named))
    return {path: _start_pair(key, leaf, config.rank) for key, (path, leaf) in zip(keys, named, strict=True)}


def merge_lora(params: dict, pairs: dict[str, LoraPair], config: LoraConfig) -> dict:
    """The adapted parameters, in the base's own types."""

    def adapted(path, leaf):
        pair = pairs.get(_path(path))
        if pair is None:
            return leaf
        change = jnp.matmul(pair.down, pair.up, precision=jax.lax.Precision.HIGHEST)
        return (leaf + config.gain * change).astype(leaf.dtype)

    return jax.tree_util.tree_map_with_path(adapted, params)


def leaves_by_path(params: dict) -> dict[str, jax.Array]:
    """Leaves by their paths, such as steps/control/ffn_in/kernel."""
    return {_path(path): leaf for path, leaf in jax.tree_util.tree_leaves_with_path(params)}


def _start_pair(key, kernel, rank):
    *stack, features, out = kernel.shape
    down = jax.random.normal(key, (*stack, features, rank)) * features**-0.5
    return LoraPair(down, jnp.zeros((*stack, rank, out)))


def _path(path):
    return "/".join(key.key for key in path)


def _name(path):
    """steps/control/ffn_in/kernel -> ffn_in; nothing for what is no kernel."""
    *_, name, last = ("", *path.split("/"))
    return name if last == "kernel" else ""
