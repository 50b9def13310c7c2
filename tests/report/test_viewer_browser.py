"""The viewer in a real browser, from disk: it shows what our rasterizer shows, keeps to the safe area, and asks
nothing of the network. Needs Playwright and a Chromium, its own or the system's."""

import cv2
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.rasterize import ADDED, LEAST, RasterizeConfig, render
from rein3d_jax.report.floor_map import FloorMap
from rein3d_jax.report.viewer import render_viewer
from tests.report.conftest import SAFE

SIZE, FOV = 256, 70  # pixels, degrees
VARIANCE = 10.0  # pixels^2; a splat of the room has about as much


@pytest.fixture(scope="module")
def page(open_viewer):
    """The page, open."""
    return open_viewer(SIZE, SIZE)


def seen(page, until, index, x=0.0, y=0.0, yaw=0.0, pitch=0.0):
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
def test_it_shows_what_the_rasterizer_shows(page, until, room, pose):
    x, y, yaw, pitch = pose
    camera = pinhole_camera(upright(jnp.array([x, y, 0.0]), yaw, pitch), SIZE, np.radians(FOV))
    frame, _ = render(room[0], camera, config=RasterizeConfig())
    ours = np.asarray(frame.rgb + 0.5 * (1 - frame.alpha[..., None]))  # the page's backdrop
    print(f"PSNR at {pose}: {(found := psnr(seen(page, until, 1, *pose), ours)):.1f} dB")
    # SPZ's colours are in 270 steps and its sizes in steps of 6 %, the browser composites in 8 bits: a mirrored or
    # turned picture, or one in linear light, is under 20 dB.
    assert found > 30


def test_it_widens_splats_as_the_rasterizer_does(chromium, until, room, tmp_path):
    """Splats apart from each other, each about as large as the filter: by the other filter they are fainter."""
    scene = room[0].replace(alive=jnp.arange(room[0].alive.size) % 101 == 0, sh=0 * room[0].sh + 1.5)
    page = chromium.new_context(viewport={"width": SIZE, "height": SIZE}).new_page()
    camera, found = pinhole_camera(upright(jnp.zeros(3), 0.3, 0.1), SIZE, np.radians(FOV)), {}
    plan, ours = FloorMap(4 * SAFE, SAFE, (SAFE[:2],), np.zeros((0, 2))), {}
    for kind in (LEAST, ADDED):
        frame, _ = render(scene, camera, config=RasterizeConfig(filter=kind, filter_variance=VARIANCE))
        ours[kind] = frame.rgb + 0.5 * (1 - frame.alpha[..., None])  # the page's backdrop
    for kind in (LEAST, ADDED):
        file, spz = tmp_path / f"{kind}.html", encode_spz(scene)
        file.write_text(render_viewer({"scene": spz}, None, plan, pixel_filter=(kind, VARIANCE)), encoding="utf-8")
        page.goto(file.as_uri(), wait_until="commit")
        until(page, "!!globalThis.viewer && viewer.settled()")
        shown = seen(page, until, 0, yaw=0.3, pitch=0.1)
        found |= {(kind, other): psnr(shown, picture) for other, picture in ours.items()}
    print({pair: f"{value:.1f} dB" for pair, value in found.items()})
    for kind, other in ((LEAST, ADDED), (ADDED, LEAST)):
        assert found[kind, kind] > found[kind, other] + 10  # dB; SPZ's steps are in both


@pytest.mark.parametrize("pose", POSES[:3])
def test_the_panorama_is_where_it_was_taken(page, until, painted, pose):
    """Each pixel shows the colour that the room has along its ray."""
    camera = pinhole_camera(upright(jnp.zeros(3), *pose[2:]), SIZE, np.radians(FOV))
    place = (np.arange(SIZE) + 0.5 - SIZE / 2) / float(camera.focal[0])
    local = np.stack([*np.meshgrid(place, place), np.ones((SIZE, SIZE))], axis=-1)
    rays = local @ np.asarray(camera.world_from_camera)[:3, :3].T
    truth = painted(rays)
    # A byte's half step and the waves' curvature are 0.004; half a pixel of the panorama aside would be 0.03. The
    # median: the room's edges are as coarse as the panorama.
    assert np.median(np.abs(seen(page, until, 0, *pose) - truth)) < 0.01


def test_a_walk_stays_in_the_safe_area(page):
    steps = np.random.default_rng(0).normal(0, 0.2, (500, 2)).tolist()
    walk = """steps => steps.map(([dx, dy]) => {
        const limited = viewer.walk(dx, dy);
        return [viewer.here.x, viewer.here.y, limited];
    })"""
    page.evaluate("() => Object.assign(viewer.here, {x: 0, y: 0})")
    path = np.array(page.evaluate(walk, steps))
    assert (path[:, :2] >= [-0.3, -0.3]).all() and (path[:, :2] <= [0.6, 0.3]).all()
    assert np.ptp(path[:, :2], axis=0).min() > 0.5 and 50 < path[:, 2].sum() < 450  # all over it, and often at its edge
    free = ~path[1:, 2].astype(bool)
    np.testing.assert_allclose(np.diff(path[:, :2], axis=0)[free], np.array(steps)[1:][free], atol=1e-9)


def test_keys_walk_to_the_edge_which_is_shown(page, until):
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


def test_two_fingers_walk_and_one_looks(page):
    """Two fingers' way up the screen is ahead; their distance zooms."""
    page.evaluate(f"() => Object.assign(viewer.here, {{x: 0, y: 0, yaw: 0, pitch: 0, fov: {FOV}, shown: 1}})")
    finger = """([kind, id, x, y]) => view.dispatchEvent(new PointerEvent(kind,
        { pointerId: id, pointerType: 'touch', clientX: x, clientY: y, bubbles: true }))"""
    page.evaluate("() => { view.setPointerCapture = () => {}; }")  # only a real finger can be captured
    for touch in [("down", 1, 60, 200), ("move", 1, 70, 200), ("down", 2, 160, 200), ("move", 1, 70, 180),
                  ("move", 2, 160, 180), ("up", 1, 70, 180), ("up", 2, 160, 180)]:  # fmt: skip
        page.evaluate(finger, [f"pointer{touch[0]}", *touch[1:]])
    x, y, yaw, fov = page.evaluate("() => [viewer.here.x, viewer.here.y, viewer.here.yaw, viewer.here.fov]")
    assert yaw == pytest.approx(np.radians(FOV) / SIZE * 10)  # one finger, ten pixels
    # two fingers' middle went up by 20 pixels: 6 mm each, along the way that one looks
    np.testing.assert_allclose([x, y], 0.12 * np.array([np.cos(yaw), np.sin(yaw)]), atol=1e-9)
    assert fov == pytest.approx(FOV)  # they end as far apart as they began


def test_a_gamepad_walks_looks_and_rests(page, until):
    page.evaluate("() => Object.assign(viewer.here, {x: 0, y: 0, yaw: 0, pitch: 0, shown: 1})")
    page.evaluate("""() => { globalThis.pad = { mapping: 'standard', axes: [0, -1, 0, 0], buttons: [{pressed: false}] };
        navigator.getGamepads = () => [null, globalThis.pad]; }""")
    until(page, "viewer.here.x > 0.2")
    page.evaluate("() => { pad.axes = [0, 0, 1, 0]; }")
    until(page, "viewer.here.yaw < -0.2")
    page.evaluate("() => { pad.axes = [0.1, 0.1, 0.1, -0.1]; }")  # within a stick's play
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    held = page.evaluate("() => [viewer.here.x, viewer.here.y, viewer.here.yaw, viewer.here.pitch]")
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    assert page.evaluate("() => [viewer.here.x, viewer.here.y, viewer.here.yaw, viewer.here.pitch]") == held
    assert held[1] == held[3] == 0
    page.evaluate("() => { navigator.getGamepads = () => []; }")


PLACE = "#at=0.25,-0.1,40,-20,50,2"


def test_a_link_holds_the_view(open_viewer, until):
    page = open_viewer(SIZE, SIZE, place=PLACE)
    at = "() => [viewer.here.x, viewer.here.y, viewer.here.yaw, viewer.here.pitch, viewer.here.fov, viewer.here.shown]"
    np.testing.assert_allclose(page.evaluate(at), [0.25, -0.1, np.radians(40), np.radians(-20), 50, 1])
    page.keyboard.press("KeyL")
    until(page, f"location.hash === '{PLACE}' && document.getElementById('told').textContent")
    page.evaluate("() => { location.hash = '#at=9,9,0,0,500,1'; }")  # outside the safe area, no such angle
    until(page, "viewer.here.shown === 0")
    np.testing.assert_allclose(page.evaluate(at), [0.25, -0.1, 0, 0, 90, 0])
    page.evaluate("() => { location.hash = '#at=1,NaN'; }")
    np.testing.assert_allclose(page.evaluate(at), [0.25, -0.1, 0, 0, 90, 0])
    page.context.close()


def test_the_picture_is_saved_as_it_is_shown(page, until):
    shown = seen(page, until, 1, *POSES[1])
    with page.expect_download() as saving:
        page.keyboard.press("KeyP")
    saved = cv2.imread(str(saving.value.path()))[..., ::-1] / 255
    assert saving.value.suggested_filename == "view.png"
    np.testing.assert_allclose(saved, shown, atol=1.5 / 255)  # the screen's own rounding


def test_a_turn_sorts_nothing_and_draws_what_is_in_sight(page, until):
    seen(page, until, 1)
    page.evaluate("""() => { globalThis.sorts = 0; const { sortWorker } = spark, { call } = sortWorker;
        sortWorker.call = (...asked) => { globalThis.sorts += 1; return call.apply(sortWorker, asked); }; }""")
    seen(page, until, 1, yaw=2.0)
    count = "() => [globalThis.sorts, spark.uniforms.count.value, spark.activeSplats]"
    sorts, drawn, of = page.evaluate(count)
    assert sorts == 0 and 0 < drawn < of / 2  # of the sphere, 1.4 times 70 degrees either way are a quarter at most
    seen(page, until, 1, x=0.3, yaw=2.0)
    assert page.evaluate(count)[0] > 0  # a step sorts


def test_slow_frames_are_coarse_and_rest_is_sharp(page, until):
    seen(page, until, 1)
    width = "() => document.getElementById('view').width"
    assert page.evaluate(width) == SIZE
    page.evaluate("() => { globalThis.fast = FRAME.fast; FRAME.fast = 0; adapt(1); held.add('turnLeft'); }")
    until(page, "sharpness.drawn > 0")
    assert page.evaluate(width) == int(0.35 * SIZE)
    page.evaluate("() => { held.clear(); FRAME.fast = globalThis.fast; }")
    until(page, "viewer.settled()")
    assert page.evaluate(width) == SIZE


def test_names_are_text_and_the_page_is_alone_and_content(page):
    title, name, hacked = page.evaluate(
        "() => [document.title, document.querySelectorAll('#scenes button')[1].textContent, globalThis.hacked ?? null]"
    )
    assert title == name and title.startswith("</script>") and hacked is None
    assert page.complaints == []
    assert [url for url in page.requests if not url.startswith(("data:", "blob:"))] == page.requests[:1]
