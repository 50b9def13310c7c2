"""What happens beside the steps of a training run: its log, evaluations, checkpoints, and the end of the guard's
patience."""

import dataclasses
import time
from contextlib import ExitStack
from pathlib import Path

import jax
import numpy as np

from experiments.config import dump_config
from experiments.example_store import ExampleStore
from experiments.train_restore.config import TrainConfig
from experiments.train_restore.evaluate import evaluate
from experiments.train_restore.guarded_step import TrainState
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.files.training_checkpoint import TrainingCheckpoints
from rein3d_jax.io.files.training_log import TrainingLog
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.weights.restorer_weights import write_restorer
from rein3d_jax.parallel import gather


class TrainingRun:
    """Counts the steps, and looks at the state when it is time. Only the first host writes; checkpoints are all
    hosts' work. A context manager."""

    def __init__(self, config: TrainConfig, store: ExampleStore, checkpoints: TrainingCheckpoints, step: int):
        self.config, self.store, self.checkpoints, self.step = config, store, checkpoints, step
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
                f"{self.config.guard.spike:g} times the usual; lower optimizer.rate and --resume from {self.output}"
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
        values, grid = evaluate(self.store, average, self.config)
        self.score = values["held_out_gain"]
        self.log.record(self.step, values)
        self.log.picture(self.step, "held_out", grid)
        write_rgb(self.output / "samples" / f"{self.step:06d}.png", grid)
        if self.score > self.best:
            self.best = self.score
            write_restorer(self.output / "weights.npz", average, dataclasses.asdict(self.config.network))
        then, step = self.mark
        self.mark = (then + time.perf_counter() - begun, step)  # steps a second are the steps' alone
        print(f"step {self.step}  held-out holes {values['held_out_psnr']:.2f} dB, {self.score:+.2f} over the fill")
