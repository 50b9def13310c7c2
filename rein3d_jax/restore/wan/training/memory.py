"""Memory that the full-size network needs on one device, foreseen before anything is allocated.

Parameters and optimizer are counted; activations are estimates of what lives at once. XLA's own account on the CPU, in
float32 and for small sizes, is 1.01 to 1.03 of the VAE's and 0.5 to 1.2 of the transformer's (test_wan_memory.py); a
GPU in bfloat16 was not measured. Bytes throughout.
"""

import math
from dataclasses import dataclass
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import DitConfig, VaeConfig, WanConfig
from rein3d_jax.restore.wan.dit import Dit
from rein3d_jax.restore.wan.training.lora import leaves_by_path
from rein3d_jax.restore.wan.training.trainable import TrainableConfig, start_training
from rein3d_jax.restore.wan.vae import Vae
from rein3d_jax.restore.wan.windows import latent_length

GIB = 2**30


@dataclass(frozen=True)
class Workload:
    """What is restored or trained at once."""

    frames: int = 41
    height: int = 448
    width: int = 896
    batch: int = 1  # clips on one device
    train: bool = False  # with AdamW and a moving average
    trainable: TrainableConfig = TrainableConfig("all")
    shards: int = 1  # devices that share the optimizer; parameters count whole, for they are gathered to be used


@dataclass(frozen=True)
class Forecast:
    """Bytes on one device. The VAE and the transformer take turns; the larger activations count."""

    parameters: int
    optimizer: int  # gradients, two moments and the moving average, in the parameters' own types; what LoRA merges
    dit_activations: int
    vae_activations: int
    widened: int = 0  # float32 copies of the transformer's narrower parameters, which XLA makes on a CPU

    @property
    def total(self) -> int:
        """Bytes at the fullest moment."""
        transformer = self.dit_activations + self.widened
        return self.parameters + self.optimizer + max(transformer, self.vae_activations)


@cache
def dit_shapes(config: DitConfig):
    """Parameters of `Dit` as a tree of jax.ShapeDtypeStruct; nothing is allocated."""
    grid = tuple(config.patch)
    latents = jax.ShapeDtypeStruct((1, *grid, config.channels), jnp.float32)
    control = jax.ShapeDtypeStruct((1, *grid, config.control_channels), jnp.float32) if config.control_every else None
    text = jax.ShapeDtypeStruct((1, 1, config.text_dim), jnp.float32)
    timestep = jax.ShapeDtypeStruct((1,), jnp.float32)
    return jax.eval_shape(Dit(config).init, jax.random.key(0), latents, timestep, text, control)["params"]


@cache
def vae_shapes(config: VaeConfig):
    """Parameters of `Vae` as such a tree."""
    video = jax.ShapeDtypeStruct((1, 1, config.stride, config.stride, 3), jnp.float32)
    return jax.eval_shape(Vae(config).init, jax.random.key(0), video)["params"]


def count(shapes) -> int:
    """Numbers in a tree of arrays or shapes."""
    return sum(math.prod(leaf.shape) for leaf in jax.tree.leaves(shapes))


def forecast(config: WanConfig, work: Workload) -> Forecast:
    """Memory that `work` needs; training updates the transformer, the VAE stays as it is."""
    dit, vae = (_bytes(shapes) for shapes in (dit_shapes(config.dit), vae_shapes(config.vae)))
    training = _training_bytes(config.dit, work.trainable) // work.shards if work.train else 0
    activations = _dit_activations(config, work), _vae_activations(config, work)
    return Forecast(dit + vae, training, *activations, _widened(dit_shapes(config.dit)))


def require_fit(config: WanConfig, work: Workload, capacity: int) -> Forecast:
    """The forecast. Raises InputError, with what would help, if it exceeds `capacity` bytes of one device."""
    need = forecast(config, work)
    if need.total > capacity:
        advice = [text for applies, text in _advice(config, work, need, capacity) if applies]
        raise InputError(
            f"{work.frames} x {work.height} x {work.width}, batch {work.batch}, needs {need.total / GIB:.1f} GiB of "
            f"{capacity / GIB:.1f} GiB a device: {'; '.join(advice)}"
        )
    return need


def tokens(config: WanConfig, work: Workload) -> int:
    """Tokens of a clip, its anchor frame included."""
    side = work.height // config.vae.stride * (work.width // config.vae.stride)
    return (1 + latent_length(work.frames)) * side // math.prod(config.dit.patch)


def _advice(config, work, need, capacity):
    fixed = need.parameters + need.optimizer
    return [
        (work.train and not config.dit.remat, "set dit.remat"),
        (work.train and work.trainable.part == "all", "train the adapter alone"),
        (config.dit.dtype == "float32", "set dit.dtype to bfloat16"),
        (work.batch > 1, "lower the batch a device, or use more devices"),
        (not work.train and config.dit.param_dtype == "float32", "set dit.param_dtype to bfloat16"),
        (need.vae_activations > need.dit_activations and config.vae.dtype == "float32", "set vae.dtype to bfloat16"),
        (config.dit.kernel == "chunked" and config.dit.query_chunk > 256, "lower dit.query_chunk"),
        (
            fixed > capacity,
            f"parameters and optimizer alone take {fixed / GIB:.1f} GiB: shard them or take a smaller network",
        ),
        (fixed <= capacity, "take fewer frames or smaller panoramas"),
    ]


def _dit_activations(config, work):
    dit, length = config.dit, tokens(config, work)
    size = np.dtype(jnp.dtype(dit.dtype)).itemsize
    row = work.batch * length * size
    queries = length if dit.kernel == "xla" else min(dit.query_chunk, length)
    # Logits and weights of one chunk: float32, and the weights once more in dtype. A fused kernel stores neither.
    logits = 0 if dit.kernel == "cudnn" else work.batch * dit.heads * queries * length * (8 + size)
    if not work.train:  # x, control, normed, query, key, value, out, hint; ffn before and after its gelu
        return row * (8 * dit.width + 2 * dit.ffn) + logits
    # What autodiff stores of a block: about 24 values a channel, 8 of them in float32, and 8 a channel of the ffn,
    # most of them for the derivative of its gelu.
    block = row * ((16 + 8 * max(4 // size, 1)) * dit.width + 8 * dit.ffn)
    blocks = dit.depth + dit.depth // dit.control_every if dit.control_every else dit.depth
    stored = blocks * row * dit.width + 2 * block if dit.remat else blocks * block
    return stored + 2 * logits


def _training_bytes(config, trainable):
    """Bytes of four numbers for each that is trained. LoRA's merged kernels exist beside the base, and so do their
    gradients."""
    shapes = dit_shapes(config)
    if trainable.part != "lora":
        return 4 * _bytes(start_training(None, shapes, trainable)[0])
    pairs = jax.eval_shape(lambda: start_training(jax.random.key(0), shapes, trainable)[0])
    return 4 * _bytes(pairs) + 2 * _bytes([leaf for path, leaf in leaves_by_path(shapes).items() if path in pairs])


def _vae_activations(config, work):
    """Bytes of the full-size stage, the widest: a convolution's padded input, its output, the shortcut, a norm."""
    size = np.dtype(jnp.dtype(config.vae.dtype)).itemsize
    return 4 * work.batch * work.frames * work.height * work.width * config.vae.base * size


def _widened(shapes):
    """A CPU has no products of narrow numbers: XLA widens all parameters before the loop over the blocks (measured: 8.5
    of 4.3 GiB, benchmarks/results/rehearsal.json)."""
    narrow = [leaf for leaf in jax.tree.leaves(shapes) if leaf.dtype.itemsize < 4]
    return 4 * count(narrow) if jax.default_backend() == "cpu" else 0


def _bytes(shapes):
    return sum(math.prod(leaf.shape) * leaf.dtype.itemsize for leaf in jax.tree.leaves(shapes))
