"""What a training run of the full-size network is. The defaults are the paper's (Sec. 5.1): VACE-1.3B, 41 frames of
448 x 896, 32 clips a step, 5,000 steps of AdamW at 5e-5."""

import dataclasses

from experiments.train_restore.config import GuardConfig, OptimizerConfig
from rein3d_jax.errors import InputError
from rein3d_jax.parallel import BACKENDS
from rein3d_jax.restore.wan.config import DitConfig, WanConfig
from rein3d_jax.restore.wan.restore import SampleConfig
from rein3d_jax.restore.wan.training.objective import ObjectiveConfig
from rein3d_jax.restore.wan.training.trainable import TrainableConfig


@dataclasses.dataclass(frozen=True)
class PairsConfig:
    folder: str = "runs/pairs_paper"  # what experiments.build_dataset wrote
    held_out: int = 4  # the folder's first pairs: never trained on, they choose the best checkpoint

    def __post_init__(self):
        if self.held_out < 1:
            raise InputError("data.held_out must be at least 1")


@dataclasses.dataclass(frozen=True)
class WanTrainConfig:
    model: str = "diffusion"  # what experiments.train_restore tells the recipes apart by
    output: str = "runs/wan"
    weights: str | None = None  # a folder as wan_weights.py reads it; none starts from random numbers, the VAE's too
    seed: int = 0
    steps: int = 5000
    batch: int = 32  # clips a step, over all devices
    accumulate: int = 8  # parts that a step's batch is taken in, to save memory
    backend: str = "jit"  # jit over a mesh | pmap
    devices: int = 0  # 0: all
    sharded: bool = False  # parameters and optimizer split over the devices (FSDP), for memory; backend jit
    log_every: int = 10  # steps
    evaluate_every: int = 500
    save_every: int = 250
    network: WanConfig = WanConfig(DitConfig(remat=True))
    trainable: TrainableConfig = TrainableConfig(part="all")
    objective: ObjectiveConfig = ObjectiveConfig()
    sampling: SampleConfig = SampleConfig(guidance=1.0)  # of the pictures; text is dropped, so nothing can guide
    data: PairsConfig = PairsConfig()
    optimizer: OptimizerConfig = OptimizerConfig(rate=5e-5, warmup=0, second_momentum=0.999, average=0.999)
    guard: GuardConfig = GuardConfig()

    def __post_init__(self):
        for name in ("steps", "batch", "accumulate", "log_every", "evaluate_every", "save_every"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} {getattr(self, name)} must be at least 1")
        if self.batch % self.accumulate:
            raise InputError(f"accumulate {self.accumulate} does not divide batch {self.batch}")
        if self.backend not in BACKENDS:
            raise InputError(f'backend "{self.backend}" is unknown; choose one of {", ".join(BACKENDS)}')
        if self.sharded and self.backend != "jit":
            raise InputError('sharded needs backend "jit"')
        if self.optimizer.warmup + self.optimizer.cooldown > self.steps:
            raise InputError(f"optimizer.warmup and optimizer.cooldown leave nothing of {self.steps} steps")
