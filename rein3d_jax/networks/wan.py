"""The full-size network's weights in a folder, as diffusers lays it out, and its embedded prompts:

    transformer/    safetensors of the transformer, in the names of diffusers or of Wan's own release
    vae/            the same of the VAE
    text/           one safetensors file: `text` and `no_text`, embedded prompts (512, text_dim), zeros after their ends

A text encoder five times the network's size is not worth having for one fixed prompt: embed it once, elsewhere.
"""

from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.safetensors_folder import load_params, save_params, tensor_names
from rein3d_jax.restore.wan.config import WanConfig
from rein3d_jax.restore.wan.names import TensorRow, dit_rows, layout_of, vae_rows
from rein3d_jax.restore.wan.restore import WanParams
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes

_TEXT_LENGTH = 512  # of an embedded prompt: the padding takes part in attention, so it may not be left out
_PROMPTS = ("text", "no_text")


def read_wan(folder: str | Path, config: WanConfig) -> WanParams:
    """Parameters from a folder. Raises InputError, naming the folder or tensor, for what is missing, unknown or of
    another shape."""
    folder = Path(folder)
    for name in ("transformer", "vae", "text"):
        if not (folder / name).is_dir():
            raise InputError(f"{folder} has no folder {name}: it needs transformer, vae and text (networks/wan.py)")
    text = _text_shapes(config)
    return WanParams(
        dit=_read(folder / "transformer", dit_rows, dit_shapes(config.dit), config.dit),
        vae=_read(folder / "vae", vae_rows, vae_shapes(config.vae), config.vae),
        **load_params(folder / "text", _text_rows(text), text),
    )


def write_wan(folder: str | Path, params: WanParams, config: WanConfig) -> None:
    """Writes what `read_wan` reads, in the names of diffusers."""
    folder = Path(folder)
    dit, vae = dit_rows(params.dit, config.dit, "diffusers"), vae_rows(params.vae, config.vae, "diffusers")
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
        return jnp.asarray(random.normal(size=leaf.shape) * fan**-0.5, leaf.dtype)

    return jax.tree_util.tree_map_with_path(draw, shapes)


def _stacked(path, leaf) -> int:
    """Number of blocks that a leaf holds."""
    return leaf.shape[0] if path[0].key == "steps" else 1


def _read(folder: Path, rows_of, shapes: Any, config: Any) -> Any:
    return load_params(folder, rows_of(shapes, config, layout_of(tensor_names(folder))), shapes)


def _text_shapes(config: WanConfig) -> dict[str, jax.ShapeDtypeStruct]:
    return {name: jax.ShapeDtypeStruct((_TEXT_LENGTH, config.dit.text_dim), jnp.float32) for name in _PROMPTS}


def _text_rows(texts: dict[str, Any]) -> list[TensorRow]:
    return [TensorRow((name,), None, name, x.shape, (0, 1)) for name, x in texts.items()]
