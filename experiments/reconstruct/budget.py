"""What a scene may take: Gaussians, bytes of scene.ply, seconds. The stages then model no more than that."""

import dataclasses
import time
from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.pipeline.pipeline import Stages

EXPLORED, REFINED = 0.6, 0.9  # shares of the seconds after which no path is begun, and refinement ends


@dataclass(frozen=True)
class BudgetConfig:
    gaussians: int = 0  # 0, here and below: no limit
    bytes: int = 0  # of scene.ply
    seconds: float = 0.0  # of the job but for its writing; what was begun is finished
    tolerance: float = 0.0  # dB that refinement may leave unreached: it stops at looks that bring less

    def __post_init__(self):
        if min(self.gaussians, self.bytes, self.seconds, self.tolerance) < 0:
            raise InputError("budget.gaussians, bytes, seconds and tolerance must not be below 0")


def bytes_of_one(sh_degree: int) -> int:
    """Of a Gaussian in scene.ply: place, normal, opacity, scales, quaternion and colours, 4 bytes each."""
    return 4 * (3 + 3 + 1 + 3 + 4 + 3 * (sh_degree + 1) ** 2)


def within(stages: Stages, budget: BudgetConfig) -> Stages:
    """The stages with the limits of `budget` laid over their own; the clock apart."""
    refine = stages.refine
    limits = [refine.most, budget.gaussians, budget.bytes // bytes_of_one(refine.sh_degree)]
    if 0 < budget.bytes < bytes_of_one(refine.sh_degree):
        raise InputError(f"budget.bytes {budget.bytes} holds no Gaussian; one takes {bytes_of_one(refine.sh_degree)}")
    most = min((limit for limit in limits if limit > 0), default=0)
    plateau = max(refine.plateau, budget.tolerance)
    return dataclasses.replace(stages, refine=dataclasses.replace(refine, most=most, plateau=plateau))


class Clock:
    """Starts when made, and says when the budget's seconds are spent; a budget without seconds never is."""

    def __init__(self, budget: BudgetConfig):
        self.started, self.seconds = time.perf_counter(), budget.seconds

    def elapsed(self) -> float:
        """Seconds."""
        return time.perf_counter() - self.started

    def explored(self) -> bool:
        """Whether no further path should be begun."""
        return self.seconds > 0 and self.elapsed() > EXPLORED * self.seconds

    def refined(self) -> bool:
        """Whether refinement should end."""
        return self.seconds > 0 and self.elapsed() > REFINED * self.seconds
