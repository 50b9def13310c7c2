"""The learned restorer's training run: its held-out evaluation and its weights."""

import dataclasses

from experiments.train_restore.learned.held_out import score_held_out
from experiments.train_restore.run import HeldOut, TrainingRun
from rein3d_jax.io.weights.restorer_weights import write_restorer


class LearnedRun(TrainingRun):
    """A TrainingRun on an ExampleStore, whose score is the gain in decibels over the background fill."""

    def held_out(self, average: dict) -> HeldOut:
        """Evaluation of averaged parameters on the clips held out."""
        figures, picture = score_held_out(self.data, average, self.config)
        gain = figures["held_out_gain"]
        return HeldOut(
            gain, figures, picture, f"held-out holes {figures['held_out_psnr']:.2f} dB, {gain:+.2f} over the fill"
        )

    def write_weights(self, average: dict) -> None:
        """Writes weights.npz of averaged parameters."""
        write_restorer(self.output / "weights.npz", average, dataclasses.asdict(self.config.network))
