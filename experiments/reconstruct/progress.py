"""What a person sees while the job runs: a bar with the time left on a terminal, a line for each stage anywhere."""

import sys
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

from experiments.reconstruct.stage_store import Finished


class Progress:
    """One bar over the whole job, in foreseen seconds."""

    def __init__(self, config, *, foreseen_seconds: dict[str, float], foreseen_bytes: int):
        plain = {"highlight": False, "soft_wrap": True, "markup": False, "emoji": False}  # a path may hold [b] or :on:
        # A log takes no control codes, whatever FORCE_COLOR says.
        self.console = Console(**plain, force_terminal=sys.stdout.isatty())
        columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        unseen = not (self.console.is_interactive or self.console.is_jupyter)
        self.bars = Bars(*columns, console=self.console, transient=True, disable=unseen)
        self.seconds, self.passed, self.looked = foreseen_seconds, 0.0, False
        self.paths, self.steps = config.explore.trajectories, max(config.refine.steps, 1)
        self.task = self.bars.add_task("reading", total=foreseen_seconds["total"])
        total, memory = foreseen_seconds["total"], foreseen_bytes / 2**30
        self.console.print(f"this will take about {total:.0f} s and {memory:.1f} GiB of memory")

    def __enter__(self):
        self.bars.start()
        return self

    def __exit__(self, *_):
        self.bars.stop()

    def done(self, stage: Finished) -> None:
        """A stage is finished, or was found finished."""
        self.console.print(f"{stage.name:<12} {'found finished' if stage.found else f'{stage.seconds:.1f} s'}")
        kind = stage.name.split("-")[0]
        self.passed += self.seconds[kind] / (self.paths if kind == "restore" else 1)
        self.bars.update(self.task, completed=self.passed, description=f"after {stage.name}")

    def tell(self, line: str) -> None:
        """What else is foreseen; nothing for ""."""
        if line:
            self.console.print(line)

    def look(self, output: Path) -> None:
        """There is something to see; told once."""
        if not self.looked:
            self.console.print(f"open {output / 'viewer.html'} for a first look, while the job goes on")
        self.looked = True

    def step(self, number: int) -> None:
        """`number` refinement steps are done."""
        completed = self.passed + self.seconds["refine"] * number / self.steps
        self.bars.update(self.task, completed=completed, description="refine")

    def finish(self, output: Path, metrics: dict) -> None:
        """The last lines: what came out, and what to open."""
        for name, values in metrics.get("quality", {}).items():
            self.console.print(f"{name:<12} PSNR {values['psnr']:.2f} dB, SSIM {values['ssim']:.3f} at novel views")
        total, peak = metrics["seconds"]["total"], metrics["peak_bytes"] / 2**30
        self.console.print(f"{metrics['count']['refined']:,} Gaussians in {total:.0f} s, peak memory {peak:.1f} GiB")
        self.console.print(f"open {output / 'viewer.html'} and {output / 'report.html'}")
