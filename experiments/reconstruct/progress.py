"""What a person sees while the job runs: a bar with the time left on a terminal, a line for each stage anywhere."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from experiments.reconstruct.stage_store import Finished

_STAGE_COST = {"read": 8, "lift": 5, "explore": 2, "peel": 8, "restore": 16}  # in refinement steps, on a laptop's CPU


class Progress:
    """One bar over the whole job. Work is counted in refinement steps; other stages by what they cost of those."""

    def __init__(self, config):
        self.console = Console(highlight=False, soft_wrap=True)
        columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        self.bars = Bars(*columns, console=self.console, transient=True)
        paths = config.explore.trajectories
        total = sum(_STAGE_COST.values()) + (paths - 1) * _STAGE_COST["restore"] + config.refine.steps
        self.task, self.before_steps, self.looked = self.bars.add_task("reading", total=total), 0, False

    def __enter__(self):
        self.bars.start()
        return self

    def __exit__(self, *_):
        self.bars.stop()

    def done(self, stage: Finished) -> None:
        """A stage is finished, or was found finished."""
        self.console.print(f"{stage.name:<12} {'found finished' if stage.found else f'{stage.seconds:.1f} s'}")
        self.before_steps += _STAGE_COST.get(stage.name.split("-")[0], 0)
        self.bars.update(self.task, completed=self.before_steps, description=f"after {stage.name}")

    def look(self, output: Path) -> None:
        """There is something to see; told once."""
        if not self.looked:
            self.console.print(f"open {output / 'viewer.html'} for a first look, while the job goes on")
        self.looked = True

    def step(self, number: int) -> None:
        """`number` refinement steps are done."""
        self.bars.update(self.task, completed=self.before_steps + number, description="refine")

    def finish(self, output: Path, metrics: dict) -> None:
        """The last lines: what came out, and what to open."""
        for name, values in metrics.get("quality", {}).items():
            self.console.print(f"{name:<12} PSNR {values['psnr']:.2f} dB, SSIM {values['ssim']:.3f} at novel views")
        total, peak = metrics["seconds"]["total"], metrics["peak_bytes"] / 2**30
        self.console.print(f"{metrics['count']['refined']:,} Gaussians in {total:.0f} s, peak memory {peak:.1f} GiB")
        self.console.print(f"open {output / 'viewer.html'} and {output / 'report.html'}")
