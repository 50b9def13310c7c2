"""Pages that `view` serves of a run: the viewer over its scenes when it is done, its progress while it runs."""

from collections.abc import Callable
from functools import partial
from html import escape
from pathlib import Path

import numpy as np

from experiments.reconstruct.pages.run_report import room_plan
from experiments.run_folder import RunFolder, open_run
from experiments.view.server import Pages
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.report.chart import Chart, Series, line_chart
from rein3d_jax.report.style import STYLE
from rein3d_jax.report.viewer import render_viewer

_FILES = {"report.html": "text/html", "flythrough.mp4": "video/mp4", "scene.ply": "application/octet-stream"}
_SPZ = "application/octet-stream"
_REFRESH = 5  # seconds
_CURVES = {"loss": ("Loss", "loss"), "psnr": ("PSNR of held-out views", "dB"), "count": ("Gaussians", "count")}


def pages(run: RunFolder) -> Pages:
    """Every path that is served, with its media type and what makes its content."""
    return {
        "/": ("text/html", lambda: _front(run.path)),
        "/viewer": ("text/html", lambda: _viewer(open_run(run.path))),
        "/coarse.spz": (_SPZ, _encoded(run.path, "stages/lift.npz", lambda fresh: fresh.coarse)),
        "/sofar.spz": (_SPZ, _encoded(run.path, "stages/unfinished.npz", lambda fresh: fresh.unfinished)),
        "/refined.spz": (_SPZ, _encoded(run.path, "scene.ply", lambda fresh: fresh.refined)),
        **{f"/{name}": (media, partial(_file, run.path / name)) for name, media in _FILES.items()},
    }


def _front(path: Path) -> bytes:
    run = open_run(path)
    return _viewer(run) if run.finished else _progress(run)


def _viewer(run: RunFolder) -> bytes:
    """The viewer over what there is: the refined scene, or else what refining has reached. Raises InputError before the
    scene was lifted and explored."""
    scenes = {"Coarse": "/coarse.spz"}
    if run.finished:
        scenes["Refined"] = "/refined.spz"
    elif (run.path / "stages" / "unfinished.npz").exists():
        scenes["So far"] = "/sofar.spz"
    raster = run.config.rasterize
    page = render_viewer(
        scenes, encode_jpeg(np.asarray(run.panorama.rgb)), room_plan(run.trajectories, run.config.explore, []),
        backdrop=np.asarray(run.backdrop), pixel_filter=(raster.filter, raster.filter_variance),
    )  # fmt: skip
    return page.encode()


def _encoded(path: Path, file: str, scene: Callable) -> Callable[[], bytes]:
    """The scene as SPZ, encoded again only when its file has changed."""
    last: dict[int, bytes] = {}

    def encoded() -> bytes:
        require_file(path / file)
        changed = (path / file).stat().st_mtime_ns
        if changed not in last:
            last.clear()
            last[changed] = encode_spz(scene(open_run(path)))
        return last[changed]

    return encoded


def _file(path: Path) -> bytes:
    require_file(path)
    return path.read_bytes()


def _progress(run: RunFolder) -> bytes:
    """A page that asks for itself again until the viewer takes its place."""
    rows = "".join(f"<tr><td>{escape(name)}</td><td>{escape(state)}</td></tr>" for name, state in run.progress())
    charts = "".join(f"<figure><h2>{title}</h2>{line_chart(chart)}</figure>" for title, chart in _charts(run))
    explored = (run.path / "stages" / "explore.npz").exists()
    viewer = '<p><a href="/viewer">The scene so far</a></p>' if explored else ""
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>Working</title>'
        f'<meta http-equiv="refresh" content="{_REFRESH}"><link rel="icon" href="data:,"><style>{STYLE}</style></head>'
        f"<body><main><h1>Your room is being made</h1><p>{escape(str(run.path))}; this page asks again every "
        f"{_REFRESH} seconds.</p>{viewer}<table><thead><tr><th>Stage</th><th>State</th></tr></thead>"
        f"<tbody>{rows}</tbody></table>"
        f'<div class="row wide">{charts}</div></main></body></html>\n'
    ).encode()


def _charts(run: RunFolder):
    try:
        curves = run.curves(_CURVES)
    except InputError:  # no held-out evaluation yet
        return
    for name, points in curves.items():
        title, unit = _CURVES[name]
        yield title, Chart(title, "step", unit, (Series(unit, points[:, 0], points[:, 1]),))
