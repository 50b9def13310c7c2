"""The viewer in a real browser, from disk: it shows what our rasterizer shows, keeps to the safe area, and asks
nothing of the network. Needs Playwright and a Chromium, its own or the system's."""

import shutil
import time

import cv2
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.io.pictures.image import encode_png
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.rasterize import RasterizeConfig, render
from rein3d_jax.report.floor_map import FloorMap
from rein3d_jax.report.viewer import render_viewer
from rein3d_jax.scene import Gaussians

playwright = pytest.importorskip("playwright.sync_api", reason="pip install 'rein3d-jax[browser]'")

SIZE, FOV = 256, 70  # pixels, degrees
ROWS = 96
SAFE = np.array([[0.6, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.6, -0.3]])  # metres
HOSTILE = "</script><script>globalThis.hacked = 1</script>"
# OpenGL in software, so that a machine without a display or GPU can
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
PATIENCE = 240  # seconds; a picture takes 1 to 20 on a busy core
SH_C0 = 0.28209479177387814


@pytest.fixture(scope="module")
def room(box_room):
    """One splat a ray of a small panorama, and the panorama."""
    rays = box_room.rays(ROWS, 2 * ROWS)
    distance = box_room.distance(np.zeros(3), rays)
    points = rays * distance[..., None]
    n, colour = distance.size, box_room.colour(points)
    spread = np.log(distance.reshape(n, 1) * np.pi / ROWS * 0.6).repeat(3, axis=1)
    sh = ((colour - 0.5) / SH_C0).reshape(n, 1, 3)
    quats = np.tile([1.0, 0, 0, 0], (n, 1))
    fields = (points.reshape(n, 3), spread, quats, np.full(n, 4.0), sh)
    return Gaussians(*(jnp.asarray(field, jnp.float32) for field in fields), jnp.ones(n, bool)), colour


@pytest.fixture(scope="module")
def page(room, tmp_path_factory):
    """The page, open; what it complained of and asked for."""
    scene, panorama = room
    plan = FloorMap(4 * SAFE, SAFE, (SAFE[:2],), np.zeros((0, 2)))
    html = render_viewer({HOSTILE: encode_spz(scene)}, encode_png(panorama), plan, title=HOSTILE)
    path = tmp_path_factory.mktemp("viewer") / "viewer.html"
    path.write_text(html, encoding="utf-8")
    with playwright.sync_playwright() as engine:
        try:
            browser = engine.chromium.launch(args=FLAGS, executable_path=shutil.which("chromium"))
        except playwright.Error as error:
            pytest.skip(
                f"no browser: apt install chromium, or playwright install chromium ({str(error).splitlines()[0]})"
            )
        opened = browser.new_page(viewport={"width": SIZE, "height": SIZE})
        opened.complaints, opened.requests = [], []
        opened.on("console", lambda said: opened.complaints.append(f"{said.type}: {said.text}"))
        opened.on("pageerror", lambda error: opened.complaints.append(str(error)))
        opened.on("request", lambda request: opened.requests.append(request.url))
        opened.goto(path.as_uri(), wait_until="commit")
        until(opened, "!!globalThis.viewer && viewer.settled()")
        yield opened
        browser.close()


def until(page, condition):
    """Waits in here: the page's policy forbids Playwright's own way, which is eval."""
    end = time.monotonic() + PATIENCE
    while not page.evaluate(f"() => {condition}"):
        assert time.monotonic() < end, page.evaluate("() => document.body.innerText")
        time.sleep(0.1)


def seen(page, index, x=0.0, y=0.0, yaw=0.0, pitch=0.0):
    """(SIZE, SIZE, 3) in [0, 1]: the picture alone."""
    page.evaluate("() => document.body.classList.add('bare')")
    page.evaluate(f"() => viewer.show({index})")
    page.evaluate(f"() => Object.assign(viewer.here, {{x: {x}, y: {y}, yaw: {yaw}, pitch: {pitch}, fov: {FOV}}})")
    page.evaluate("() => viewer.redraw()")
    until(page, "viewer.settled()")
    picture = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    page.evaluate("() => document.body.classList.remove('bare')")
    return picture[..., ::-1] / 255


def psnr(a, b):
    return -10 * np.log10(np.mean((np.asarray(a) - b) ** 2))


POSES = [(0, 0, 0, 0), (0, 0, 1.3, 0.4), (0, 0, -2.5, -0.6), (0.5, -0.2, 0.7, 0)]


@pytest.mark.parametrize("pose", POSES)
def test_it_shows_what_the_rasterizer_shows(page, room, pose):
    x, y, yaw, pitch = pose
    camera = pinhole_camera(upright(jnp.array([x, y, 0.0]), yaw, pitch), SIZE, np.radians(FOV))
    frame, _ = render(room[0], camera, config=RasterizeConfig())
    ours = np.asarray(frame.rgb + 0.5 * (1 - frame.alpha[..., None]))  # the page's backdrop
    print(f"PSNR at {pose}: {(found := psnr(seen(page, 1, *pose), ours)):.1f} dB")
    # SPZ's colours are in 270 steps and its sizes in steps of 6 %, the browser composites in 8 bits: a mirrored or
    # turned picture, or one in linear light, is under 20 dB.
    assert found > 30


@pytest.mark.parametrize("pose", POSES[:3])
def test_the_panorama_is_where_it_was_taken(page, room, box_room, pose):
    """Each pixel shows the colour that the room has along its ray."""
    camera = pinhole_camera(upright(jnp.zeros(3), *pose[2:]), SIZE, np.radians(FOV))
    place = (np.arange(SIZE) + 0.5 - SIZE / 2) / float(camera.focal[0])
    local = np.stack([*np.meshgrid(place, place), np.ones((SIZE, SIZE))], axis=-1)
    rays = local @ np.asarray(camera.world_from_camera)[:3, :3].T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    truth = box_room.colour(rays * box_room.distance(np.zeros(3), rays)[..., None])
    # A byte's half step and the waves' curvature are 0.004; half a pixel of the panorama aside would be 0.03. The
    # median: the box's outline is as coarse as the panorama.
    assert np.median(np.abs(seen(page, 0, *pose) - truth)) < 0.01


def test_a_walk_stays_in_the_safe_area(page):
    steps = np.random.default_rng(0).normal(0, 0.2, (500, 2)).tolist()
    walk = """steps => steps.map(([dx, dy]) => {
        const limited = viewer.walk(dx, dy);
        return [viewer.here.x, viewer.here.y, limited];
    })"""
    page.evaluate("() => Object.assign(viewer.here, {x: 0, y: 0})")
    path = np.array(page.evaluate(walk, steps))
    low, high = SAFE.min(axis=0), SAFE.max(axis=0)
    assert (path[:, :2] >= low).all() and (path[:, :2] <= high).all()
    assert np.ptp(path[:, :2], axis=0).min() > 0.5 and 50 < path[:, 2].sum() < 450  # all over it, and often at its edge
    free = ~path[1:, 2].astype(bool)
    np.testing.assert_allclose(np.diff(path[:, :2], axis=0)[free], np.array(steps)[1:][free], atol=1e-9)


def test_keys_walk_to_the_edge_which_is_shown(page):
    page.evaluate("() => { viewer.show(1); Object.assign(viewer.here, {x: 0, y: 0, yaw: 0}); }")
    until(page, "viewer.settled() && document.getElementById('edge').hidden")
    page.keyboard.down("KeyW")
    until(page, "!document.getElementById('edge').hidden")
    page.keyboard.up("KeyW")
    x, y = page.evaluate("() => [viewer.here.x, viewer.here.y]")
    assert 0.3 < x <= 0.6 and y == 0  # forward is +x; a frame walks 0.12 m at most
    page.keyboard.press("Home")
    assert page.evaluate("() => [viewer.here.x, viewer.here.y]") == [0, 0]


def test_a_drag_turns_the_view(page):
    page.set_viewport_size({"width": 800, "height": 600})  # so that names leave some of the picture free
    page.evaluate(f"() => Object.assign(viewer.here, {{yaw: 0, pitch: 0, fov: {FOV}}})")
    page.mouse.move(400, 450)
    page.mouse.down()
    page.mouse.move(500, 410, steps=2)
    page.mouse.up()
    yaw, pitch = page.evaluate("() => [viewer.here.yaw, viewer.here.pitch]")
    page.set_viewport_size({"width": SIZE, "height": SIZE})
    # What is under the hand goes right and up: one looks left and down, by the angle of as many pixels.
    np.testing.assert_allclose([yaw, pitch], np.radians(FOV) / 600 * np.array([100, -40]), rtol=1e-6)


def test_names_are_text_and_the_page_is_alone_and_content(page):
    assert page.evaluate("() => [document.title, viewer.here.shown >= 0, globalThis.hacked ?? null]") == [
        HOSTILE,
        True,
        None,
    ]
    assert page.evaluate("() => document.querySelectorAll('#scenes button')[1].textContent") == HOSTILE
    assert page.complaints == []
    assert [url for url in page.requests if not url.startswith(("data:", "blob:"))] == page.requests[:1]
