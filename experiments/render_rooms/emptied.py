"""Finished rooms seen again without their furniture: what their panoramas lack of it, and the plan for it."""

import json
from pathlib import Path

_TAKEN = ("seconds", "gains")  # what a panorama's record says besides its plan
_FILES = {"empty": (".png", ".npz"), "exit": (".npz",)}
_SAME = ("seed", "corners", "models", "look")  # drawn first to last: rooms that share these share all


def missing_emptied(room: Path) -> tuple[str, ...]:
    """What a still panorama of the finished `room` lacks: "empty" (KKK_empty.png and .npz), "exit" (KKK_exit.npz)."""
    stills = [path.stem for path in room.glob("*.npz") if _is_still(path.stem)]
    return tuple(
        part
        for part, ends in _FILES.items()
        if not all((room / f"{name}_{part}{end}").exists() for name in stills for end in ends)
    )


def emptied_plan(plan: dict, record: dict) -> dict | None:
    """`plan` with its still panoramas alone, each with the gains of `record`, its room.json; None if they disagree.

    They do where the room was planned by other code, or for other panoramas: a walk draws numbers too."""
    plan = json.loads(json.dumps(plan))  # as it was written: lists where tuples were
    told = [{key: value for key, value in panorama.items() if key not in _TAKEN} for panorama in record["panoramas"]]
    if plan["panoramas"] != told or any(plan[key] != record[key] for key in _SAME):
        return None
    gains = [panorama["gains"] for panorama in record["panoramas"]]
    paired = zip(plan["panoramas"], gains, strict=True)
    stills = [{**panorama, "gains": gain} for panorama, gain in paired if _is_still(panorama["name"])]
    return {**plan, "panoramas": stills}


def _is_still(name: str) -> bool:
    """Neither the finer copy nor of a walk."""
    return name.isdigit()
