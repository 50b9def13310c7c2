"""The trained network of the recipe's restorer, read from restore.weights."""

import hashlib
from functools import cache
from pathlib import Path

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.io.weights.restorer_weights import SHIPPED_RESTORER, read_restorer
from rein3d_jax.networks.wan import read_wan, require_wan
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.network import initial_parameters
from rein3d_jax.restore.learned.sample import Learned
from rein3d_jax.restore.restorer import DIFFUSION, LEARNED, RestoreConfig, TrainedNetwork


def read_network(config: RestoreConfig) -> TrainedNetwork | None:
    """Trained network of the restorer; None for the fills. Raises InputError for weights that are missing, damaged or
    made for another network, and for a size of picture that the network does not take."""
    if config.method == LEARNED:
        return _learned(config)
    if config.method != DIFFUSION:
        return None
    diffusion = config.diffusion
    return read_wan(_folder(config), diffusion.network, words=diffusion.sample.words, lora=diffusion.lora)


def require_network(config: RestoreConfig) -> None:
    """Raises InputError as `read_network` does, without reading what is large."""
    if config.method == LEARNED:
        _learned(config)
    elif config.method == DIFFUSION:
        diffusion = config.diffusion
        require_wan(_folder(config), diffusion.network, words=diffusion.sample.words, lora=diffusion.lora)


def weights_fingerprint(config: RestoreConfig) -> str:
    """Hash of the weights' files: a resumed job must not mix two networks. Empty for the fills."""
    if config.method == DIFFUSION:
        lora = config.diffusion.lora.file
        return files_digest(_folder(config)) + ("" if lora is None else files_digest(Path(lora)))
    return files_digest(Path(config.weights or SHIPPED_RESTORER)) if config.method == LEARNED else ""


def files_digest(path: Path) -> str:
    """Hash of a weights file, or of a folder's safetensors. Raises InputError where there is none."""
    if not path.exists():
        raise InputError(f"{path} is not there: name a file or a folder of weights")
    digest = hashlib.sha256()
    for file in sorted(path.rglob("*.safetensors")) if path.is_dir() else [path]:
        with open(file, "rb") as content:
            digest.update(hashlib.file_digest(content, "sha256").digest())
    return digest.hexdigest()


def _folder(config: RestoreConfig) -> Path:
    """Of the diffusion network's weights."""
    if config.weights is None or not Path(config.weights).is_dir():
        missing = "is missing" if config.weights is None else f"{config.weights} is no folder"
        raise InputError(
            f"restore.weights {missing}: train one (python -m experiments.train_restore --config paper_train), or give "
            "a folder of Wan2.1-VACE-1.3B's weights (experiments/README.md, Weights, says where they are had)"
        )
    return Path(config.weights)


def _learned(config: RestoreConfig) -> Learned:
    path = config.weights or SHIPPED_RESTORER
    parameters, sizes = read_restorer(path)
    try:
        network = NetworkConfig(**sizes)
    except TypeError as error:
        raise InputError(f"{path} names sizes that this network does not have: train it again") from error
    if path != SHIPPED_RESTORER and _wanted(network) != _shapes(parameters):  # of the packaged one, a test tells
        raise InputError(f"{path} does not hold the arrays of its own network's sizes: train it again")
    times, rest = divmod(config.height, network.rows)
    if rest or times & (times - 1):
        raise InputError(f"restore.height {config.height} must be {network.rows} times a power of 2 for {path}")
    return Learned(parameters, network)


@cache  # it is asked before a job's long part and in it, and traces the whole network
def _wanted(network: NetworkConfig) -> dict:
    return _shapes(jax.eval_shape(lambda: initial_parameters(jax.random.key(0), network)))


def _shapes(tree) -> dict:
    return {jax.tree_util.keystr(path): leaf.shape for path, leaf in jax.tree_util.tree_leaves_with_path(tree)}
