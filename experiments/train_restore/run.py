"""What happens beside the steps of a training run: its log, evaluations, checkpoints, and the end of the guard's
patience."""

import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from experiments.config import dump_config
from experiments.train_restore.config import TrainConfig
from experiments.train_restore.guarded_step import TrainState
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.io.files.training_log import TrainingLog
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.parallel import gather


class HeldOut(NamedTuple):
    """Result of a held-out evaluation."""

    score: float  # the higher, the better
    figures: dict[str, float]  # for the log
    picture: np.ndarray  # (h, w, 3) in [0, 1]
    summary: str


class TrainingRun:
    """Counts the steps, and evaluates, logs and saves when it is time. Only the first host writes; checkpoints are all
    hosts' work. A context manager; each network's own has `held_out` and `write_weights`, of averaged parameters."""

    def __init__(self, config: TrainConfig, data: Any, checkpoints: TrainingCheckpoints, step: int):
        self.config, self.data, self.checkpoints, self.step = config, data, checkpoints, step
        self.output, self.writes = Path(config.output), jax.process_index() == 0
        self.score, self.best = -np.inf, checkpoints.best_score()
        self.mark = (time.perf_counter(), step)
        self.closing = ExitStack()

    def __enter__(self):
        if self.writes:
            self.log = self.closing.enter_context(TrainingLog(self.output))
            write_text(self.output / "config.toml", dump_config(self.config))
        return self

    def __exit__(self, *_):
        self.closing.close()

    def after(self, state: TrainState, metrics: dict[str, jax.Array]) -> None:
        """A step is done. Raises InputError when too many in a row were refused."""
        self.step += 1
        last = self.step == self.config.steps
        if self.step % self.config.log_every == 0 or last:
            self._log({name: float(value) for name, value in gather(metrics).items()})
        if self.step % self.config.evaluate_every == 0 or last:
            self._evaluate(state)
        if self.step % self.config.save_every == 0 or last:
            self.checkpoints.save(self.step, state, self.score)

    def _log(self, values: dict[str, float]) -> None:
        if values["in_a_row"] >= self.config.guard.patience:
            raise InputError(
                f"{values['in_a_row']:.0f} steps in a row gave a gradient that is not finite or more than "
                f"{self.config.guard.spike:g} times its running norm; lower optimizer.rate and --resume from "
                f"{self.output}"
            )
        now, (then, step) = time.perf_counter(), self.mark
        values["steps_per_second"] = (self.step - step) / max(now - then, 1e-9)
        self.mark = (now, self.step)
        if self.writes:
            self.log.record(self.step, values)
            left = (self.config.steps - self.step) / max(values["steps_per_second"], 1e-9) / 60
            print(
                f"step {self.step}/{self.config.steps}  loss {values['loss']:.4f}  gradient {values['gradient']:.3f}  "
                f"skipped {values['skipped']:.0f}  {values['steps_per_second']:.2f} steps/s  {left:.0f} min left",
                flush=True,
            )

    def _evaluate(self, state: TrainState) -> None:
        average, begun = gather(state.average), time.perf_counter()
        if not self.writes:
            return
        found = self.held_out(average)
        self.score = found.score
        self.log.record(self.step, found.figures)
        self.log.picture(self.step, "held_out", found.picture)
        write_rgb(self.output / "samples" / f"{self.step:06d}.png", found.picture)
        if self.score > self.best:
            self.best = self.score
            self.write_weights(average)
        then, step = self.mark
        self.mark = (then + time.perf_counter() - begun, step)  # steps a second are the steps' alone
        print(f"step {self.step}  {found.summary}", flush=True)


def clips_per_device(config: TrainConfig, devices: int) -> int:
    """Clips of a part of a step's batch on each device. Raises InputError where they do not divide."""
    clips, rest = divmod(config.batch // config.accumulate, devices)
    if rest:
        raise InputError(f"batch {config.batch} / accumulate {config.accumulate} does not divide by {devices} devices")
    return clips


def last_step(config: TrainConfig, checkpoints: TrainingCheckpoints, resume: bool) -> int | None:
    """Step of the last checkpoint; None for a new run. Raises InputError where there is one but no `resume`."""
    last = checkpoints.last()
    if last is not None and not resume:
        raise InputError(f"{config.output} holds a run of {last} steps: --resume it, or choose another output")
    return last
