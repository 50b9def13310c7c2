"""What a scene may take: Gaussians, bytes of scene.ply, seconds. The stages then model no more than that."""

import dataclasses
from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.pipeline.stages import Stages
from rein3d_jax.settings import Settings, setting

_BYTES, _BYTES_OF_A_PIXEL = 2_200_000_000, 2_000


@dataclass(frozen=True)
class BudgetConfig(Settings):
    """Limits of the whole job; 0 sets none."""

    gaussians: int = setting(0, "Gaussians of the scene", within="[0, inf)")
    bytes: int = setting(0, "of scene.ply", within="[0, inf)", unit="bytes")
    seconds: float = setting(
        0.0, "of the whole job: chooses the best plan that is foreseen to keep to them (plans.py)", within="[0, inf)"
    )
    tolerance: float = setting(
        0.0, "that refinement may leave unreached: it stops where evaluations bring less", within="[0, inf)", unit="dB"
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
    plateau = max(refine.plateau, budget.tolerance)
    return dataclasses.replace(stages, refine=dataclasses.replace(refine, max_count=max_count, plateau=plateau))


def foreseen_bytes(rows: int) -> int:
    """Peak memory of a job that works at so many rows, with a share of 0.5 Gaussians a pixel: measured on a CPU,
    compilers and all (2.6, 3.2 and 6.4 GB at 256, 512 and 1024 rows). Views larger than quick's are not in it."""
    return _BYTES + _BYTES_OF_A_PIXEL * 2 * rows * rows


def check_memory(rows: int, available: int) -> None:
    """Raises InputError where a job at so many rows would not fit into `available` bytes."""
    if foreseen_bytes(rows) <= available:
        return
    fits = next((less for less in range(rows, 0, -32) if foreseen_bytes(less) <= available), 0)
    mend = f"set input.height = {fits}" if fits else "take a machine with more"
    needed, has = (f"{x / 1e9:.1f} GB" for x in (foreseen_bytes(rows), available))
    raise InputError(f"{2 * rows} x {rows} pixels take about {needed} of memory, and there are {has}: {mend}")
