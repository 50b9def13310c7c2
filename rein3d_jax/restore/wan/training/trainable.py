"""The part of the transformer that is trained; the rest stays as it is and needs no optimizer.

`start_training` parts the parameters once, `assemble` joins them at each step and at the end.
"""

from dataclasses import dataclass
from typing import Any

import jax

from rein3d_jax.restore.wan.training.lora import LoraConfig, merge_lora, start_pairs
from rein3d_jax.settings import Settings, setting

TRAINABLE_PARTS = ("all", "adapter", "lora")
_ADAPTER = {"control_embed", "control_in", "control", "hint"}  # VACE's context adapter: what Wan itself has not


@dataclass(frozen=True)
class TrainableConfig(Settings):
    """Which part of the transformer is trained."""

    part: str = setting("adapter", "all, VACE's context adapter (its own recipe), or LoRA", among=TRAINABLE_PARTS)
    lora: LoraConfig = LoraConfig()


def start_training(key: jax.Array, params: dict, config: TrainableConfig) -> tuple[Any, Any]:
    """Trained and frozen parameters, two pytrees; without LoRA both have the parameters' form, and None where the other
    has a leaf. A new LoRA or a new adapter changes nothing yet; the key is for the first."""
    if config.part == "lora":
        return start_pairs(key, params, config.lora), params
    return tuple(_where(params, lambda path, part=part: trains(path, config) == part) for part in (True, False))


def assemble(trained: Any, frozen: Any, config: TrainableConfig) -> dict:
    """Parameters for `Dit`. Differentiate with respect to `trained` alone."""
    if config.part == "lora":
        return merge_lora(frozen, trained, config.lora)
    return jax.tree.map(lambda a, b: b if a is None else a, trained, frozen, is_leaf=lambda leaf: leaf is None)


def trains(path: tuple, config: TrainableConfig) -> bool:
    """Whether the leaf at `path` (jax.tree_util's keys) is one of those trained itself, as no LoRA's are."""
    return config.part == "all" or not _ADAPTER.isdisjoint(key.key for key in path)


def _where(params, chosen):
    return jax.tree_util.tree_map_with_path(lambda path, leaf: leaf if chosen(path) else None, params)
