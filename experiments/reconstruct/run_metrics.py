"""metrics.json: what a run cost, how large its scene is, why each stage stopped, how good it is."""

import resource
from collections.abc import Sequence
from pathlib import Path

from experiments.reconstruct.stage_store import StageStore
from rein3d_jax.refine import STOPPED
from rein3d_jax.scene import Gaussians, Panorama


def cost(store: StageStore) -> dict:
    """Seconds by stage, and the most memory that the process held."""
    seconds = {**{name: round(value, 3) for name, value in store.seconds.items()}, "write": 0.0, "total": 0.0}
    return {"seconds": seconds, "peak_bytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024}


def size(panorama: Panorama, coarse: Gaussians, refined: Gaussians, ply: Path) -> dict:
    """Gaussians before and after, beside the panorama's pixels; bytes of the scene."""
    living = {"lift": int(coarse.alive.sum()), "refined": int(refined.alive.sum())}
    return {"count": {"pixels": int(panorama.distance.size), **living}, "bytes": {ply.name: ply.stat().st_size}}


def choices(store: StageStore, revealed: Sequence[float], paths: int, least: float, curves: dict) -> dict:
    """What each path revealed and cost, why exploring and refining ended, and what refining brought at each look."""
    taken = [
        {"revealed": share, "restored": share >= least, "seconds": round(store.each[f"restore-{index:02d}"], 3)}
        for index, share in enumerate(revealed)
    ]
    explored = "all paths taken" if len(revealed) == paths else "the budget's seconds were spent"
    looks = [{"step": int(step), "held_out_psnr": round(float(psnr), 3)} for step, psnr in curves["psnr"]]
    return {"paths": taken, "looks": looks,
            "stopped": {"explore": explored, "refine": STOPPED[int(curves["stopped"])]}}  # fmt: skip


def trouble(overflow: dict[str, int], curves: dict) -> dict:
    """What found no room, by the key that makes room, and steps that were skipped or buffers that had to grow."""
    counts = {"reallocated": int(curves["reallocated"]), "skipped_steps": int(curves["skipped"])}
    return {"overflow": sum(overflow.values()), "overflows": overflow, **counts}
