"""The full-size network's weights in a folder, as diffusers lays it out, and its embedded prompts:

    transformer/    safetensors of the transformer, in the names of diffusers or of Wan's own release
    vae/            the same of the VAE
    text/           one safetensors file: `text` and `no_text`, embedded prompts (512, text_dim), zeros after their ends

Each is a file or shards with an index, of any float type, 8-bit ones with or without scales. A text encoder five times
the network's size is not worth having for one fixed prompt: embed it once, elsewhere, or go without words.
"""

from functools import partial
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.lora_file import read_lora_file
from rein3d_jax.io.weights.safetensors_folder import Changes, load_params, require_tensors, save_params, tensor_names
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.lora_names import LoraFileConfig, lora_change, lora_parts
from rein3d_jax.restore.wan.names import LAYOUTS, TensorRow, dit_rows, layout_of, vae_rows
from rein3d_jax.restore.wan.restore import WanParams
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes

_TEXT_LENGTH = 512  # of an embedded prompt: the padding takes part in attention, so it may not be left out
_PROMPTS = ("text", "no_text")


def read_wan(
    folder: str | Path, config: WanConfig, *, words: bool = True, lora: LoraFileConfig = LoraFileConfig()
) -> WanParams:
    """Parameters from a folder, with a LoRA merged in. Raises InputError as `require_wan` does.

    Without words text/ is not read. A single token of zeros then stands for the prompt: attention to any number of
    equal tokens gives the same.
    """
    folder = Path(folder)
    _require_folders(folder, words)
    tables = _tables(folder, config)
    text = _text_shapes(config) if words else {}
    none = jnp.zeros((1, config.dit.text_dim))
    texts = load_params(folder / "text", _text_rows(text), text) if words else dict.fromkeys(_PROMPTS, none)
    changes = _changes(lora, tables["transformer"], config)
    return WanParams(
        dit=load_params(folder / "transformer", tables["transformer"], dit_shapes(config.dit), changes=changes),
        vae=load_params(folder / "vae", tables["vae"], vae_shapes(config.vae)),
        **texts,
    )


def require_wan(
    folder: str | Path, config: WanConfig, *, words: bool = True, lora: LoraFileConfig = LoraFileConfig()
) -> None:
    """Raises InputError, naming the folder or tensor, for what is missing, unknown or of another shape. Of the network
    only headers are read."""
    folder = Path(folder)
    _require_folders(folder, words)
    tables = _tables(folder, config)
    if words:
        tables["text"] = _text_rows(_text_shapes(config))
    for name, rows in tables.items():
        require_tensors(folder / name, rows)
    _changes(lora, tables["transformer"], config)


def write_wan(folder: str | Path, params: WanParams, config: WanConfig, *, layout: str = "diffusers") -> None:
    """Writes what `read_wan` reads, in the names of `layout`."""
    folder = Path(folder)
    dit, vae = dit_rows(params.dit, config.dit, layout), vae_rows(params.vae, config.vae, layout)
    texts = {name: getattr(params, name) for name in _PROMPTS}
    for name, rows, part in (("vae", vae, params.vae), ("text", _text_rows(texts), texts)):
        save_params(folder / name, rows, part)
    save_params(folder / "transformer", dit, params.dit)  # last: it is the one that a reader looks for


def random_wan(seed: int, config: WanConfig) -> WanParams:
    """Parameters of an untrained network and VAE, with text of zeros: for trying out what handles weights. Drawn by
    NumPy, since compiling the modules' own initialisers takes longer than a tiny training run."""
    random = np.random.default_rng(seed)
    dit, vae = (_drawn(random, shapes) for shapes in (dit_shapes(config.dit), vae_shapes(config.vae)))
    return WanParams(dit, vae, **{name: jnp.zeros(x.shape, x.dtype) for name, x in _text_shapes(config).items()})


def _drawn(random: np.random.Generator, shapes: Any) -> Any:
    """Leaves as the modules' initialisers draw them: kernels preserve variance, norms are 1, control has no effect
    yet."""

    def draw(path, leaf):
        *_, name, last = ("", *(key.key for key in path))
        if last in ("scale", "query_norm", "key_norm"):
            return jnp.ones(leaf.shape, leaf.dtype)
        if last == "bias" or name in ("hint", "control_in"):
            return jnp.zeros(leaf.shape, leaf.dtype)
        fan = leaf.shape[-1] if last == "modulation" else np.prod(leaf.shape[:-1]) // _stacked(path, leaf)
        return jnp.asarray(random.standard_normal(leaf.shape, np.float32) * np.float32(fan**-0.5), leaf.dtype)

    return jax.tree_util.tree_map_with_path(draw, shapes)


def _stacked(path, leaf) -> int:
    """Number of blocks that a leaf holds."""
    return leaf.shape[0] if path[0].key == "steps" else 1


def _require_folders(folder: Path, words: bool) -> None:
    needed = ("transformer", "vae", "text") if words else ("transformer", "vae")
    for name in needed:
        if not (folder / name).is_dir():
            raise InputError(
                f"{folder} has no folder {name}: it needs {', '.join(needed)} (experiments/README.md, Weights)"
            )


def _tables(folder: Path, config: WanConfig) -> dict[str, tuple[TensorRow, ...]]:
    """The network's rows under the names that its files have."""
    parts = {"transformer": (dit_rows, dit_shapes(config.dit), config.dit)}
    parts["vae"] = (vae_rows, vae_shapes(config.vae), config.vae)
    return {name: rows(*of, layout_of(tensor_names(folder / name))) for name, (rows, *of) in parts.items()}


def _changes(lora: LoraFileConfig, base: tuple[TensorRow, ...], config: WanConfig) -> Changes:
    if lora.file is None:
        return {}
    layouts = [dit_rows(dit_shapes(config.dit), config.dit, layout) for layout in LAYOUTS]
    try:
        parts = lora_parts(read_lora_file(lora.file), base, layouts)
    except InputError as error:
        raise InputError(f"restore.diffusion.lora.file: {lora.file} {error}") from error
    shapes = {row.name: row.shape for row in base}
    return {name: partial(lora_change, of, shapes[name], lora.scale) for name, of in parts.items()}


def _text_shapes(config: WanConfig) -> dict[str, jax.ShapeDtypeStruct]:
    return {name: jax.ShapeDtypeStruct((_TEXT_LENGTH, config.dit.text_dim), jnp.float32) for name in _PROMPTS}


def _text_rows(texts: dict[str, Any]) -> list[TensorRow]:
    return [TensorRow((name,), None, name, x.shape, (0, 1)) for name, x in texts.items()]
