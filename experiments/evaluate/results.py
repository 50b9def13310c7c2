"""Figures over rooms: each room's are stored in a file of their own as soon as they are there, so that a run that was
killed goes on; and the table of all, as the JSON file holds it."""

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.evaluate.protocols import Outcome
from rein3d_jax import __version__
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.frechet import feature_statistics, frechet_distance
from rein3d_jax.evaluate.standard_error import over_rooms
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.json_file import read_json

LAYOUT = 1  # of a stored file; count up when a figure changes its meaning


def stored_outcome(file: Path, depends: dict, make: Callable[[], Outcome]) -> tuple[Outcome, bool]:
    """The outcome in `file` if it was made from the very same `depends`, and True; else made and stored, and False."""
    wanted = {**depends, "layout": LAYOUT, "version": __version__}
    key = hashlib.sha256(json.dumps(wanted, sort_keys=True).encode()).hexdigest()
    found = _read(file, key)
    if found is not None:
        return found, True
    outcome = make()
    # NaN is no JSON: a figure that the room cannot give is left out.
    known = {name: value for name, value in outcome.figures.items() if not math.isnan(value)}
    outcome = dataclasses.replace(outcome, figures=known)
    write_text(file, json.dumps({"key": key, **dataclasses.asdict(outcome)}) + "\n")
    return outcome, False


def _read(file: Path, key: str) -> Outcome | None:
    """None if there is none, or another job's, or a damaged one."""
    try:
        stored = read_json(file)
        return Outcome(stored["figures"], stored["features"]) if stored["key"] == key else None
    except (InputError, KeyError, TypeError):
        return None


def table(outcomes: dict[str, Outcome], features: str) -> dict[str, dict]:
    """{metric: {mean, sem, rooms}} of one method's outcomes by room; `features` names those of the Frechet distance."""
    metrics = {name: None for outcome in outcomes.values() for name in outcome.figures}  # a set that keeps its order
    rows = {metric: _over(metric, outcomes) for metric in metrics}
    pairs = [outcome.features for outcome in outcomes.values() if outcome.features]
    if len(pairs) > 1:
        shown, truth = (feature_statistics(np.array(side)) for side in zip(*pairs, strict=True))
        # One distance of all rooms' clips: it has no standard error, and no value by room.
        rows[f"frechet_{features}"] = {
            "mean": frechet_distance(*shown, *truth),
            "sem": None,
            "rooms": {},
            "clips": len(pairs),
        }
    return rows


def _over(metric: str, outcomes: dict[str, Outcome]) -> dict:
    values = {room: outcome.figures[metric] for room, outcome in outcomes.items() if metric in outcome.figures}
    mean, sem, _ = over_rooms(jnp.array(list(values.values()), jnp.float32))
    return {"mean": _rounded(mean), "sem": _rounded(sem), "rooms": {k: _rounded(v) for k, v in values.items()}}


def _rounded(value: float) -> float | None:
    """Six digits; None, JSON's null, for what is not a number."""
    return None if not math.isfinite(value) else float(f"{float(value):.6g}")


def line(protocol: str, method: str, room: str, figures: dict[str, float], found: bool) -> str:
    """What a person sees when a room is done."""
    shown = [f"{name} {figures[name]:.3g}" for name in _SHOWN if name in figures]
    return f"{protocol:<12} {room:<10} {method:<14} {', '.join(shown)}{' (found finished)' if found else ''}"


_SHOWN: Sequence[str] = (
    "psnr",
    "psnr_hole",
    "psnr_observed",
    "ssim",
    "lpips",
    "niqe",
    "brisque",
    "coverage",
    "seconds",
)
