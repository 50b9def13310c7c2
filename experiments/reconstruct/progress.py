"""What a person sees while the job runs: a bar with the time left on a terminal, a line for each stage anywhere."""

from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as Bars

STAGE_COST = {"read": 8, "lift": 5, "explore": 2, "restore": 16}  # in refinement steps, on a laptop's CPU


class Progress:
    """One bar over the whole job. Work is counted in refinement steps; other stages by what they cost of those."""

    def __init__(self, config):
        self.console = Console(highlight=False, soft_wrap=True)
        columns = (TextColumn("{task.description:<12}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
        self.bars = Bars(*columns, console=self.console, transient=True)
        paths = config.explore.trajectories
        total = sum(STAGE_COST.values()) + (paths - 1) * STAGE_COST["restore"] + config.refine.steps
        self.task = self.bars.add_task("reading", total=total)

    def __enter__(self):
        self.bars.start()
        return self

    def __exit__(self, *_):
        self.bars.stop()

    def done(self, name: str, seconds: float, reused: bool) -> None:
        """A stage is finished, or was found finished."""
        note = "found finished" if reused else f"{seconds:.1f} s"
        self.console.print(f"{name:<12} {note}")
        cost = STAGE_COST.get(name.split("-")[0], 0)
        self.bars.update(self.task, advance=cost, description=f"after {name}")

    def step(self, number: int) -> None:
        """One refinement step is done."""
        self.bars.update(self.task, advance=1, description="refine")

    def finish(self, output: Path, metrics: dict) -> None:
        """The last lines: what came out, and what to open."""
        for name, values in metrics.get("quality", {}).items():
            self.console.print(f"{name:<12} PSNR {values['psnr']:.2f} dB, SSIM {values['ssim']:.3f} at novel views")
        total, peak = metrics["seconds"]["total"], metrics["peak_bytes"] / 2**30
        self.console.print(f"{metrics['count']['refined']:,} Gaussians in {total:.0f} s, peak memory {peak:.1f} GiB")
        self.console.print(f"open {output / 'viewer.html'} and {output / 'report.html'}")
