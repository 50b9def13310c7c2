"""metrics.json: what a run cost, how large its scene is, why each stage stopped, how good it is."""

import resource
from pathlib import Path

from experiments.reconstruct.stage_store import StageStore
from rein3d_jax.depth.level import Lean
from rein3d_jax.explore.profile import ExploreConfig
from rein3d_jax.pipeline.reconstruct import Reconstruction


def cost(store: StageStore, total: float) -> dict:
    """Seconds by stage; of these for programs, traced and compiled; the processor's; the most memory held."""
    used = resource.getrusage(resource.RUSAGE_SELF)
    return {
        "seconds": _rounded(store.seconds() | {"total": total}),
        "program_seconds": {part: _rounded(of) for part, of in store.programs().items()},
        "cpu_seconds": round(used.ru_utime + used.ru_stime, 1),
        "peak_bytes": used.ru_maxrss * 1024,
    }


def _rounded(seconds: dict[str, float]) -> dict[str, float]:
    return {name: round(value, 3) for name, value in seconds.items()}


def size(result: Reconstruction, ply: Path) -> dict:
    """Gaussians before and after, beside the panorama's pixels; bytes of the scene."""
    living = {"lift": int(result.coarse.alive.sum()), "refined": int(result.scene.alive.sum())}
    return {"count": {"pixels": int(result.panorama.distance.size), **living}, "bytes": {ply.name: ply.stat().st_size}}


def choices(result: Reconstruction, store: StageStore, explore: ExploreConfig) -> dict:
    """What each path revealed and cost, why exploring and refining ended, and what each held-out evaluation found."""
    seconds = {stage.name: round(stage.seconds, 3) for stage in store.finished}
    paths = [
        {"revealed": share, "restored": share >= explore.min_revealed, "seconds": seconds[f"restore-{index:02d}"]}
        for index, share in enumerate(result.decisions.revealed)
    ]
    found = [{"step": int(step), "held_out_psnr": round(float(psnr), 3)} for step, psnr in result.curves.psnr]
    stopped = {"explore": result.decisions.explored, "refine": result.decisions.refined}
    return {"paths": paths, "evaluations": found, "stopped": stopped}


def lean(found: Lean) -> dict:
    """How the picture leaned, in degrees, and what was done about it."""
    numbers = {name: round(float(getattr(found, name)), 3) for name in ("degrees", "roll", "pitch", "confidence")}
    return {"verdict": found.verdict, **numbers, "told": found.sentence}


def trouble(result: Reconstruction) -> dict:
    """What found no room, by the key that makes room, and steps that were skipped or buffers that had to grow."""
    overflow = {
        "explore.max_frames": int(result.trajectories.overflow.sum()),
        "lift.capacity": int(result.decisions.overflow),
        "refine.spare": int(result.curves.overflow),
    }
    counts = {"reallocated": int(result.curves.reallocated), "skipped_steps": int(result.curves.skipped)}
    return {"overflow": sum(overflow.values()), "overflows": overflow, **counts}
