"""Settings of a training run of the learned restorer."""

from dataclasses import dataclass

from experiments.train_restore.config import TrainConfig
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import LossConfig
from rein3d_jax.restore.noise import NOISES
from rein3d_jax.settings import Settings, setting

_PRECISIONS = ("float32", "bfloat16")


@dataclass(frozen=True)
class ExampleDataConfig(Settings):
    """Examples that are trained on."""

    folder: str = setting("runs/examples", "that experiments.build_examples wrote")
    validation: str = setting("", "folder of other rooms, all held out, in place of the first clips of `folder`")
    frames: int = setting(4, "of each clip, the anchor among them, drawn anew each time", within="[2, inf)")
    held_out: int = setting(16, "first clips, never trained on, which choose the best checkpoint", within="[1, inf)")


@dataclass(frozen=True)
class LearnedTrainConfig(TrainConfig):
    """A training run of the learned restorer."""

    precision: str = setting("float32", "of the network's arithmetic, not of its parameters", among=_PRECISIONS)
    noise: float = setting(0.0, "share of examples below noise level 1; 0: one-step prediction alone", within="[0, 1]")
    noise_kind: str = setting("latitude", "correlated as pixels crowd, white, or the paper's warp", among=tuple(NOISES))
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    data: ExampleDataConfig = ExampleDataConfig()
