"""Plans of the main job, from the fastest to the best: what `budget.seconds` chooses among.

A plan is settings laid over a recipe's. Which are here, and in what order, was measured on rooms with ground truth
(`python -m benchmarks.studies.plans`, `benchmarks/results/plans.json`): each brings more than those before it."""

from collections.abc import Callable
from typing import NamedTuple

from experiments.config import changed
from experiments.reconstruct.config import ReconstructConfig

_NO_PATHS = ("explore.trajectories=1", "refine.steps=0")
_SMALL_FILM = ("film.width=320", "film.height=176", "film.step=0.4", "film.yaw_step=0.2")


class JobPlan(NamedTuple):
    """Settings, as --set takes them."""

    name: str
    settings: tuple[str, ...]


PLANS = (
    JobPlan("128 rows", ("input.height=128", "input.upsample=none", "lift.share=1", "restore.height=128",
                         *_NO_PATHS, *_SMALL_FILM)),
    JobPlan("256 rows", ("input.height=256", "input.upsample=none", "lift.share=0.5", "lift.worth=0.005",
                         "restore.height=256", *_NO_PATHS, *_SMALL_FILM)),
    JobPlan("512 by cubics", ("input.height=512", "input.upsample=bicubic", "lift.share=0.5", "lift.worth=0.01",
                              "restore.height=256", *_NO_PATHS, *_SMALL_FILM)),
    JobPlan("1024 by cubics", ("input.height=1024", "input.upsample=bicubic", "lift.share=0.25", "lift.worth=0.01",
                               "restore.height=256", *_NO_PATHS)),
    JobPlan("1024 and its paths", ("input.height=1024", "input.upsample=bicubic", "lift.share=0.25",
                                   "lift.worth=0.005", "restore.height=256", "explore.trajectories=8",
                                   "refine.steps=0")),
)  # fmt: skip


def planned(
    config: ReconstructConfig, seconds_of: Callable[[ReconstructConfig], float]
) -> tuple[ReconstructConfig, str]:
    """The config with the settings of the best plan that `seconds_of` foresees within budget.seconds, or else of the
    fastest one; and the plan's name. Without such a budget the config itself, and ""."""
    if not config.budget.seconds:
        return config, ""
    candidates = [(changed(config, plan.settings), plan.name) for plan in reversed(PLANS)]
    fitting = (one for one in candidates if seconds_of(one[0]) <= config.budget.seconds)
    return next(fitting, candidates[-1])
