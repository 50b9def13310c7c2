"""What a training run is: everything that decides its parameters, and what it shows of itself."""

import dataclasses

from rein3d_jax.errors import InputError
from rein3d_jax.parallel import BACKENDS
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import LossConfig
from rein3d_jax.restore.noise import require_kind

PRECISIONS = ("float32", "bfloat16")


@dataclasses.dataclass(frozen=True)
class DataConfig:
    folder: str = "runs/examples"  # what experiments.build_examples wrote
    validation: str = ""  # a folder of rooms drawn otherwise, all held out, in place of the first of `folder`
    frames: int = 4  # of each clip, the anchor among them, drawn anew each time
    held_out: int = 16  # clips never trained on, which choose the best checkpoint: the first ones

    def __post_init__(self):
        if self.frames < 2 or self.held_out < 1:
            raise InputError("data.frames must be at least 2 (the anchor and one more), data.held_out at least 1")


@dataclasses.dataclass(frozen=True)
class OptimizerConfig:
    rate: float = 1e-3  # AdamW's, constant between warm-up and cool-down
    warmup: int = 50  # steps
    cooldown: int = 0  # last steps, over which the rate falls to 0 along a cosine; 0 leaves it constant
    weight_decay: float = 0.01
    momentum: float = 0.9
    second_momentum: float = 0.98
    clip: float = 1.0  # greatest norm of a gradient
    average: float = 0.995  # decay of the parameters' moving average, which is what is kept for use

    def __post_init__(self):
        if self.rate <= 0 or self.clip <= 0:
            raise InputError("optimizer.rate and optimizer.clip must be above 0")
        for name in ("momentum", "second_momentum", "average"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(f"optimizer.{name} {getattr(self, name)} must lie in [0, 1)")


@dataclasses.dataclass(frozen=True)
class GuardConfig:
    spike: float = 10.0  # a gradient this many times its usual norm is not followed
    patience: int = 20  # so many steps skipped in a row end the run

    def __post_init__(self):
        if self.spike <= 1 or self.patience < 1:
            raise InputError("guard.spike must be above 1, guard.patience at least 1")


@dataclasses.dataclass(frozen=True)
class TrainConfig:
    model: str = "learned"  # what experiments.train_restore tells the recipes apart by
    output: str = "runs/restorer"
    seed: int = 0
    steps: int = 2000
    batch: int = 2  # clips a step, over all devices
    accumulate: int = 1  # parts that a step's batch is taken in, to save memory
    precision: str = "float32"  # of the network's arithmetic; parameters and optimizer stay float32
    backend: str = "jit"  # jit over a mesh | pmap
    devices: int = 0  # 0: all
    noise: float = 0.0  # share of examples at a noise level below 1; 0 trains the one-step prediction alone
    noise_kind: str = "latitude"  # latitude | white | paper
    log_every: int = 10  # steps
    evaluate_every: int = 200
    save_every: int = 100
    network: NetworkConfig = NetworkConfig()
    loss: LossConfig = LossConfig()
    data: DataConfig = DataConfig()
    optimizer: OptimizerConfig = OptimizerConfig()
    guard: GuardConfig = GuardConfig()

    def __post_init__(self):
        for name in ("steps", "batch", "accumulate", "log_every", "evaluate_every", "save_every"):
            if getattr(self, name) < 1:
                raise InputError(f"{name} {getattr(self, name)} must be at least 1")
        if self.batch % self.accumulate:
            raise InputError(f"accumulate {self.accumulate} does not divide batch {self.batch}")
        if self.precision not in PRECISIONS:
            raise InputError(f'precision "{self.precision}" is unknown; choose one of {", ".join(PRECISIONS)}')
        if self.backend not in BACKENDS:
            raise InputError(f'backend "{self.backend}" is unknown; choose one of {", ".join(BACKENDS)}')
        if not 0 <= self.noise <= 1:
            raise InputError(f"noise {self.noise} must lie between 0 and 1")
        require_kind("noise_kind", self.noise_kind)
        if self.optimizer.warmup + self.optimizer.cooldown > self.steps:
            raise InputError(f"optimizer.warmup and optimizer.cooldown leave nothing of {self.steps} steps")
