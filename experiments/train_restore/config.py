"""Settings that the training runs of both networks share."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.parallel import BACKENDS
from rein3d_jax.settings import Settings, setting

_COUNT, _POSITIVE, _DECAY = "[1, inf)", "(0, inf)", "[0, 1)"


@dataclass(frozen=True)
class OptimizerConfig(Settings):
    """AdamW, its rate over the run, and the parameters' moving average."""

    rate: float = setting(1e-3, "learning rate, constant between warm-up and cool-down", within=_POSITIVE)
    warmup: int = setting(50, "over which the rate rises from 0", within="[0, inf)", unit="steps")
    cooldown: int = setting(0, "last ones, over which the rate falls to 0 by a cosine", within="[0, inf)", unit="steps")
    weight_decay: float = setting(0.01, "of kernels, not of biases and norms", within="[0, inf)")
    momentum: float = setting(0.9, "decay of the gradient's mean", within=_DECAY)
    second_momentum: float = setting(0.98, "decay of the squared gradient's mean", within=_DECAY)
    clip: float = setting(1.0, "greatest norm of a gradient", within=_POSITIVE)
    average: float = setting(0.995, "decay of the parameters' moving average, which is what is saved", within=_DECAY)


@dataclass(frozen=True)
class GuardConfig(Settings):
    """Which steps of training are refused, and when that ends the run."""

    spike: float = setting(10.0, "a gradient this many times its running norm is not followed", within="(1, inf)")
    patience: int = setting(20, "so many steps refused in a row end the run", within=_COUNT, unit="steps")


@dataclass(frozen=True)
class TrainConfig(Settings):
    """A training run of either network."""

    model: str = setting("learned", "which network is trained", among=("learned", "diffusion"))
    output: str = setting("runs/restorer", "folder of the run")
    seed: int = setting(0, "of parameters, batches and noise", within="[0, inf)")
    steps: int = setting(2000, "of training", within=_COUNT)
    batch: int = setting(2, "clips a step, over all devices", within=_COUNT)
    accumulate: int = setting(1, "parts that a step's batch is taken in, to save memory", within=_COUNT)
    backend: str = setting("jit", "of several devices: jit over a mesh, or pmap", among=BACKENDS)
    devices: int = setting(0, "of all hosts; 0: all", within="[0, inf)")
    log_every: int = setting(10, "from one line of the log to the next", within=_COUNT, unit="steps")
    evaluate_every: int = setting(200, "from one held-out evaluation to the next", within=_COUNT, unit="steps")
    save_every: int = setting(100, "from one checkpoint to the next", within=_COUNT, unit="steps")
    optimizer: OptimizerConfig = OptimizerConfig()
    guard: GuardConfig = GuardConfig()

    def __post_init__(self):
        super().__post_init__()
        if self.batch % self.accumulate:
            raise InputError(f"accumulate must divide batch ({self.batch}), not be {self.accumulate}")
        if self.optimizer.warmup + self.optimizer.cooldown > self.steps:
            raise InputError(f"optimizer.warmup and optimizer.cooldown must leave something of {self.steps} steps")
