"""What a scene may take: Gaussians, bytes of scene.ply, seconds. The stages then model no more than that."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.settings import Settings, setting

# Of a job's most memory: Python, JAX and XLA's compilers at their busiest, the least of any job; more where the depth
# network is compiled beside them; the panorama's own maps (its partition's levels, above all); and a lifted Gaussian,
# through all that renders and writes it.
_LEAST, _OF_NETWORK, _OF_A_PIXEL, _OF_A_GAUSSIAN = 1_600_000_000, 400_000_000, 300, 480


# What a dB of tolerance is in the stages' own limits. Of lift.worth: 0.005, 0.01, 0.025, 0.05 lose 0.06, 0.25, 0.66 and
# 1.05 dB in eight rooms at 256 rows (benchmarks/README.md, "No more than a scene needs").
_WORTH, _REVEALED = 0.035, 0.025
_ADAPTIVE = 0.99  # of a share of 1, which lifts every pixel whatever it is worth


@dataclass(frozen=True)
class BudgetConfig(Settings):
    """Limits of the whole job; 0 sets none."""

    gaussians: int = setting(0, "Gaussians of the scene", within="[0, inf)")
    bytes: int = setting(0, "of scene.ply", within="[0, inf)", unit="bytes")
    seconds: float = setting(
        0.0, "of the whole job: chooses the best plan that is foreseen to keep to them (plans.py)", within="[0, inf)"
    )
    tolerance: float = setting(
        0.0, "of novel views that may be given up for fewer Gaussians, paths and steps", within="[0, 20]", unit="dB"
    )


def bytes_of_one(sh_degree: int) -> int:
    """Of a Gaussian in scene.ply: place, normal, opacity, scales, quaternion and colours, 4 bytes each."""
    return 4 * (3 + 3 + 1 + 3 + 4 + 3 * (sh_degree + 1) ** 2)


def within(stages: Stages, budget: BudgetConfig) -> Stages:
    """The stages with the limits of `budget` laid over their own; the seconds apart (plans.py)."""
    refine = stages.refine
    limits = [refine.max_count, budget.gaussians, budget.bytes // bytes_of_one(refine.sh_degree)]
    if 0 < budget.bytes < bytes_of_one(refine.sh_degree):
        raise InputError(f"budget.bytes {budget.bytes} holds no Gaussian; one takes {bytes_of_one(refine.sh_degree)}")
    max_count = min((limit for limit in limits if limit > 0), default=0)
    stages = dataclasses.replace(stages, refine=dataclasses.replace(refine, max_count=max_count))
    return _tolerant(stages, budget.tolerance) if budget.tolerance else stages


def _tolerant(stages: Stages, decibels: float) -> Stages:
    """The stages with each limit on what pays raised to what loses so much, unless it is higher already."""
    lift, explore, refine = stages.lift, stages.explore, stages.refine
    worth = max(lift.worth, _WORTH * decibels)
    revealed = max(explore.min_revealed, _REVEALED * decibels)
    return dataclasses.replace(
        stages,
        lift=dataclasses.replace(lift, share=min(lift.share, _ADAPTIVE), worth=worth),
        explore=dataclasses.replace(explore, min_revealed=revealed),
        refine=dataclasses.replace(refine, plateau=max(refine.plateau, decibels)),
    )


def foreseen_bytes(rows: int, share: float, *, estimated: bool) -> int:
    """The most memory of a first job on a CPU at so many rows, compilers and all, with at most `share` Gaussians a
    pixel, and its distance estimated or given. Views larger than quick's are not in it."""
    of_a_pixel = _OF_A_PIXEL + _OF_A_GAUSSIAN * share
    return _LEAST + _OF_NETWORK * estimated + round(of_a_pixel * 2 * rows * rows)


def check_memory(rows: int, available: int, bytes_of: Callable[[int], int]) -> None:
    """Raises InputError where a job at so many rows, for which `bytes_of` says what it takes, would not fit into
    `available` bytes."""
    if bytes_of(rows) <= available:
        return
    fits = next((less for less in range(rows, 63, -32) if bytes_of(less) <= available), 0)
    mend = f"set input.height = {fits}" if fits else "take a machine with more"
    needed, has = (f"{x / 1e9:.1f} GB" for x in (bytes_of(rows), available))
    raise InputError(f"{2 * rows} x {rows} pixels take about {needed} of memory, and there are {has}: {mend}")
