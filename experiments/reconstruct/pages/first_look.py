"""Something to see at once: the pages of what a job has so far, to be replaced as it goes on."""

from pathlib import Path

from experiments.reconstruct.pages.run_report import first_report
from experiments.reconstruct.pages.viewer_page import viewer_page
from experiments.reconstruct.run import Run
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.report.report import render_report


def write_first_look(run: Run) -> None:
    """viewer.html and report.html of a run that has no more than surveyed the panorama."""
    output = Path(run.config.output)
    write_text(output / "viewer.html", viewer_page(run))
    write_text(output / "report.html", render_report(first_report(run)))
