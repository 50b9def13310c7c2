"""A viewer page of a small room, and a real browser to open it in; tests of either are skipped without one."""

import shutil
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.io.pictures.image import encode_png
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.rasterize import RasterizeConfig
from rein3d_jax.report.floor_map import FloorMap
from rein3d_jax.report.viewer import render_viewer
from rein3d_jax.scene import Gaussians

ROOM = np.array([3.0, 2.5, 1.4])  # half sizes, metres: an empty box round the origin
SAFE = np.array([[0.6, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.6, -0.3]])  # metres
HOSTILE = "</script><script>globalThis.hacked = 1</script>"
PATIENCE = 240  # seconds; a picture takes 1 to 20 on a busy core
ROWS = 96
SH_C0 = 0.28209479177387814
# OpenGL in software, so that a machine without a display or GPU can
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]


def rays_of_panorama(height, width):
    """(height, width, 3) unit rays, as conventions.py says."""
    azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
    latitude = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi)[:, None]
    parts = (np.cos(azimuth) * np.cos(latitude), -np.sin(azimuth) * np.cos(latitude), np.sin(latitude))
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def surface(rays):
    """(..., 3) metres: where rays from the origin meet the room."""
    return rays * (ROOM / np.abs(rays)).min(axis=-1)[..., None]


def colour(points):
    """(..., 3): smooth waves of two metres and more on all surfaces, within [0, 1]."""
    phases = points @ np.array([[2.0, 0.5, 1.2], [-1.0, 2.5, 0.5], [1.5, -0.5, 3.0]]).T
    return 0.5 + 0.4 * np.sin(phases)


@pytest.fixture(scope="session")
def painted():
    """rays (..., 3) -> the colours that they have from the origin."""
    return lambda rays: colour(surface(rays))


@pytest.fixture(scope="session")
def room():
    """One splat a ray of a small panorama, and the panorama."""
    points = surface(rays_of_panorama(ROWS, 2 * ROWS))
    n, distance = ROWS * 2 * ROWS, np.linalg.norm(points, axis=-1)
    spread = np.log(distance.reshape(n, 1) * np.pi / ROWS * 0.6).repeat(3, axis=1)
    sh = ((colour(points) - 0.5) / SH_C0).reshape(n, 1, 3)
    quats = np.tile([1.0, 0, 0, 0], (n, 1))
    fields = (points.reshape(n, 3), spread, quats, np.full(n, 4.0), sh)
    return Gaussians(*(jnp.asarray(field, jnp.float32) for field in fields), jnp.ones(n, bool)), colour(points)


@pytest.fixture(scope="session")
def viewer_file(room, tmp_path_factory):
    """viewer.html: the panorama, and the scene under a hostile name."""
    scene, panorama = room
    plan = FloorMap(4 * SAFE, SAFE, (SAFE[:2],), np.zeros((0, 2)))
    ours = (RasterizeConfig.filter, RasterizeConfig.filter_variance)
    html = render_viewer({HOSTILE: encode_spz(scene)}, encode_png(panorama), plan, title=HOSTILE, pixel_filter=ours)
    path = tmp_path_factory.mktemp("viewer") / "viewer.html"
    path.write_text(html, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def chromium():
    """Chromium, the system's or Playwright's; of one module, as others start Playwright themselves."""
    playwright = pytest.importorskip("playwright.sync_api", reason="pip install 'rein3d-jax[browser]'")
    with playwright.sync_playwright() as engine:
        try:
            browser = engine.chromium.launch(args=FLAGS, executable_path=shutil.which("chromium"))
        except playwright.Error as error:
            reason = str(error).splitlines()[0]
            pytest.skip(f"no browser: apt install chromium, or playwright install chromium ({reason})")
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def open_viewer(chromium, viewer_file):
    """(width, height, *scripts to run before the page's, hash, **options of a browser's context) -> the open page, at
    rest; with what it complained of and asked for."""

    def opened(width, height, *scripts, place="", **options):
        page = chromium.new_context(viewport={"width": width, "height": height}, **options).new_page()
        page.complaints, page.requests = [], []
        page.on("console", lambda said: page.complaints.append(f"{said.type}: {said.text}"))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.on("request", lambda request: page.requests.append(request.url))
        for script in scripts:
            page.add_init_script(script)
        page.goto(viewer_file.as_uri() + place, wait_until="commit")
        _until(page, "!!globalThis.viewer && viewer.settled()")
        return page

    return opened


@pytest.fixture(scope="session")
def until():
    """(page, condition in JavaScript): waits until it holds."""
    return _until


def _until(page, condition):
    # Waits in here: the page's policy forbids Playwright's own way, which is eval.
    end = time.monotonic() + PATIENCE
    while not page.evaluate(f"() => {condition}"):
        assert time.monotonic() < end, (condition, page.complaints, page.evaluate("() => document.body.innerText"))
        time.sleep(0.1)


@pytest.fixture(scope="session")
def npm_package():
    """A path under node_modules -> the script's text; the test is skipped where npm did not put it there."""

    def text(name):
        path = Path(__file__).parents[2] / "benchmarks/viewer_build/node_modules" / name
        if not path.exists():
            pytest.skip(f"no {path.parent.name}: run npm ci in benchmarks/viewer_build")
        return path.read_text("utf-8")

    return text
