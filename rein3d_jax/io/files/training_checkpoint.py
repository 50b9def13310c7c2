"""Checkpoints of a training run (orbax): written beside the training, whole or not at all; the last and best stay."""

from pathlib import Path
from typing import Any

import jax
import numpy as np
import orbax.checkpoint as ocp
from orbax.checkpoint.checkpoint_managers import AnyPreservationPolicy, BestN, LatestN

from rein3d_jax.errors import InputError

_SCORE = "score"


class TrainingCheckpoints:
    """States by step in one folder. A context manager: leaving it waits for what is still being written."""

    def __init__(self, folder: str | Path):
        policy = AnyPreservationPolicy([LatestN(1), BestN(get_metric_fn=lambda m: m[_SCORE], n=1)])
        options = ocp.CheckpointManagerOptions(
            preservation_policy=policy, best_fn=lambda metrics: metrics[_SCORE], enable_async_checkpointing=True
        )
        self.folder = Path(folder).absolute()
        self.manager = ocp.CheckpointManager(self.folder, options=options)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.manager.wait_until_finished()
        self.manager.close()

    def save(self, step: int, state: Any, score: float) -> None:
        """Starts writing `state`, a pytree of arrays; `score` decides which is best: the greatest."""
        self.manager.save(step, args=ocp.args.StandardSave(state), metrics={_SCORE: float(score)})

    def last(self) -> int | None:
        """The step of the newest whole checkpoint."""
        return self.manager.latest_step()

    def best(self) -> int | None:
        """The step of the checkpoint with the greatest score."""
        return self.manager.best_step()

    def best_score(self) -> float:
        """The greatest score; -inf where there is none."""
        best = self.best()
        return -float("inf") if best is None else float(self.manager.metrics(best)[_SCORE])

    def restore(self, step: int, like: Any) -> Any:
        """The state saved at `step`, laid over devices as `like` is. Raises InputError if it does not fit."""
        try:
            state = self.manager.restore(step, args=ocp.args.StandardRestore(like))
            _require_shapes(state, like)
            return state
        except (ValueError, KeyError, TypeError, OSError) as error:
            reason = " ".join(str(error).split())[:300]
            name = self.folder / str(step)
            raise InputError(f"{name} does not fit this run ({reason}): choose an empty output") from error


def _require_shapes(state: Any, like: Any) -> None:
    """orbax gives NumPy arrays as they were saved, whatever shape is asked for. Raises ValueError."""
    wanted = jax.tree.leaves(like)
    for (path, leaf), other in zip(jax.tree_util.tree_leaves_with_path(state), wanted, strict=True):
        if np.shape(leaf) != np.shape(other):
            raise ValueError(f"{jax.tree_util.keystr(path)} is of {np.shape(leaf)}, not {np.shape(other)}")
