"""The upsampling network's weights, as benchmarks/convert/upsampler.py wrote them."""

from pathlib import Path

import jax

from rein3d_jax.networks.leaf_folder import read_leaf_folder
from rein3d_jax.networks.trained import files_digest
from rein3d_jax.upsample import LEARNED
from rein3d_jax.upsample.dual_aggregation import initial_upsampler

SHIPPED_UPSAMPLER = Path(__file__).resolve().parents[1] / "upsample" / "weights"


def read_upsampler(method: str = LEARNED, folder: str | Path = SHIPPED_UPSAMPLER) -> dict | None:
    """Parameters, float32, as `upsample_picture` and `upsample_video` take them; None for a method without a network.
    Raises InputError, naming the folder or tensor, for what is missing, unknown or of another shape."""
    if method != LEARNED:
        return None
    return read_leaf_folder(folder, jax.eval_shape(lambda: initial_upsampler(jax.random.key(0))))


def upsampler_fingerprint(method: str) -> str:
    """Hash of the weights that the method reads: a resumed job must not mix two networks. Empty for none."""
    return files_digest(SHIPPED_UPSAMPLER) if method == LEARNED else ""
