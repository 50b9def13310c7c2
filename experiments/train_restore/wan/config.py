"""Settings of a training run of the full-size network. The defaults are the paper's (Sec. 5.1): VACE-1.3B, 41 frames of
448 x 896, 32 clips a step, 5,000 steps of AdamW at 5e-5."""

from dataclasses import dataclass

from experiments.train_restore.config import OptimizerConfig, TrainConfig
from rein3d_jax.errors import InputError
from rein3d_jax.restore.wan.config import DitConfig, WanConfig
from rein3d_jax.restore.wan.restore import SampleConfig
from rein3d_jax.restore.wan.training.objective import ObjectiveConfig
from rein3d_jax.restore.wan.training.trainable import TrainableConfig
from rein3d_jax.settings import Settings, setting

_COUNT = "[1, inf)"


@dataclass(frozen=True)
class PairDataConfig(Settings):
    """Pairs that are trained on."""

    folder: str = setting("runs/pairs_paper", "that experiments.build_dataset wrote")
    held_out: int = setting(4, "first pairs, never trained on, which choose the best checkpoint", within=_COUNT)


@dataclass(frozen=True)
class WanTrainConfig(TrainConfig):
    """A training run of the full-size network."""

    model: str = setting("diffusion", "which network is trained", among=("learned", "diffusion"))
    output: str = setting("runs/wan", "folder of the run")
    steps: int = setting(5000, "of training", within=_COUNT)
    batch: int = setting(32, "clips a step, over all devices", within=_COUNT)
    accumulate: int = setting(8, "parts that a step's batch is taken in, to save memory", within=_COUNT)
    evaluate_every: int = setting(500, "from one held-out evaluation to the next", within=_COUNT, unit="steps")
    save_every: int = setting(250, "from one checkpoint to the next", within=_COUNT, unit="steps")
    optimizer: OptimizerConfig = OptimizerConfig(rate=5e-5, warmup=0, second_momentum=0.999, average=0.999)
    weights: str | None = setting(None, "folder to start from; none starts from random numbers, the VAE's too")
    sharded: bool = setting(False, "split parameters and optimizer over the devices (FSDP), for memory; backend jit")
    network: WanConfig = WanConfig(DitConfig(remat=True))
    trainable: TrainableConfig = TrainableConfig(part="all")
    objective: ObjectiveConfig = ObjectiveConfig()
    sampling: SampleConfig = SampleConfig(guidance=1.0)  # of the pictures; text is dropped, so nothing can guide
    data: PairDataConfig = PairDataConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.sharded and self.backend != "jit":
            raise InputError(f'backend must be "jit" where sharded is true, not "{self.backend}"')
