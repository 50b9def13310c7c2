"""The viewer in an emulated headset (Meta's Immersive Web Emulation Runtime, from npm): the session starts, both eyes
see the room, hands move one about, nothing leaves the safe area, and leaving works."""

import cv2
import numpy as np
import pytest

WIDTH, HEIGHT = 480, 240  # both eyes
FLOOR, EYES = -1.4, 1.6  # metres: the room's, and the emulator's above its floor
QUEST = """globalThis.device = new IWER.XRDevice(IWER.metaQuest3);
device.installRuntime({ forceInstall: true }); device.stereoEnabled = true;"""
NEXT_FRAMES = "() => new Promise((done) => { let n = 3; const tick = () => n-- ? inVr(tick) : done(); inVr(tick); })"


@pytest.fixture(scope="module")
def page(open_viewer, npm_package, until):
    """The page, in the headset."""
    page = open_viewer(WIDTH, HEIGHT, npm_package("iwer/build/iwer.min.js"), QUEST)
    page.locator("text=Enter VR").click()
    until(page, "edge.visible && spark.activeSplats > 0 && visit.at")
    page.evaluate("() => { globalThis.inVr = (tick) => renderer.xr.getSession().requestAnimationFrame(tick); }")
    return page


@pytest.fixture(autouse=True)
def at_rest(page):
    """Hands at rest, the visitor at the panorama's place."""
    page.evaluate("""() => { for (const hand of Object.values(device.controllers)) hand.updateAxes('thumbstick', 0, 0);
        device.controllers.right.updateButtonValue('trigger', 0); device.position.set(0, 1.6, 0); }""")
    page.evaluate(NEXT_FRAMES)
    page.evaluate("() => Object.assign(viewer.here, { x: 0, y: 0 })")
    page.evaluate(NEXT_FRAMES)


def hand(page, side, across, along):
    page.evaluate(f"() => device.controllers.{side}.updateAxes('thumbstick', {across}, {along})")


def place(page):
    return np.array(page.evaluate("() => [viewer.here.x, viewer.here.y]"))


def head(page):
    """Where the two eyes' middle is in the world, metres."""
    return np.array(page.evaluate("() => renderer.xr.getCamera().matrixWorld.elements.slice(12, 15)"))


def test_it_stands_on_the_floor_at_the_panorama_and_both_eyes_see_the_room(page):
    assert page.evaluate("() => visit.floor") == pytest.approx(FLOOR, abs=0.026)  # half a shelf of 5 cm
    eyes = np.array(page.evaluate("() => renderer.xr.getCamera().cameras.map((c) => [...c.matrixWorld.elements])"))
    at = eyes[:, 12:15]
    np.testing.assert_allclose(at.mean(axis=0), [0, 0, FLOOR + EYES], atol=0.05)  # eyes are before the head's middle
    apart = at[1] - at[0]
    assert apart[1] == pytest.approx(-0.063, abs=0.002) and abs(apart[[0, 2]]).max() < 1e-6  # the right one is at -y
    picture = cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR).astype(float)
    left, right = np.split(picture[20:-20], 2, axis=1)  # free of names
    for eye in (left, right):
        assert eye.std() > 10  # the room's waves, not the one colour of its backdrop
    assert 0.5 < np.abs(left - right).mean() < 40  # one room from two places


def test_the_left_thumbstick_walks_to_the_edge_and_no_farther(page, until):
    hand(page, "left", 0, -1)
    until(page, "viewer.here.x > 0.4")
    page.evaluate(NEXT_FRAMES)
    page.evaluate(NEXT_FRAMES)
    x, y = place(page)
    assert 0.4 < x <= 0.6 and abs(y) < 0.3
    np.testing.assert_allclose(head(page)[:2], [x, y], atol=0.05)


def test_the_right_thumbstick_turns_by_a_step_once(page, until):
    before = page.evaluate("() => viewer.here.yaw")
    hand(page, "right", 1, 0)
    page.evaluate(NEXT_FRAMES)
    page.evaluate(NEXT_FRAMES)
    assert page.evaluate("() => viewer.here.yaw") == pytest.approx(before - np.pi / 6)
    hand(page, "right", 0, 0)
    page.evaluate(NEXT_FRAMES)
    hand(page, "right", -1, 0)
    page.evaluate(NEXT_FRAMES)
    assert page.evaluate("() => viewer.here.yaw") == pytest.approx(before)
    np.testing.assert_allclose(place(page), [0, 0], atol=1e-6)  # about oneself


def test_real_steps_move_one_and_the_edge_holds(page):
    page.evaluate("() => device.position.set(0, 1.6, -0.2)")  # a step ahead
    page.evaluate(NEXT_FRAMES)
    np.testing.assert_allclose(place(page), [0.2, 0], atol=1e-6)
    page.evaluate("() => device.position.set(0, 1.6, -2)")
    page.evaluate(NEXT_FRAMES)
    x, y = place(page)
    assert x <= 0.6 and abs(y) <= 0.3
    np.testing.assert_allclose(head(page)[:2], [x, y], atol=0.05)


@pytest.mark.parametrize("down, goes", [(1.3, True), (0.5, False)])  # radians: the ray falls inside, or outside
def test_the_trigger_goes_where_the_ray_meets_the_floor(page, down, goes):
    page.evaluate(
        """(half) => { const { right } = device.controllers; right.position.set(0, 1.2, 0);
        right.quaternion.set(-Math.sin(half), 0, 0, Math.cos(half)); right.updateButtonValue('trigger', 1); }""",
        down / 2,
    )
    page.evaluate(NEXT_FRAMES)
    ray = np.array(page.evaluate("() => visit.aiming.matrixWorld.elements.slice(12, 15)"))
    target = np.array(page.evaluate("() => visit.target"))
    np.testing.assert_allclose(target, [ray[0] + (ray[2] - FLOOR) / np.tan(down), ray[1]], atol=0.03)  # a shelf's half
    assert page.evaluate("() => ring.visible && viewer.allowed(...visit.target)") is goes
    page.evaluate("() => device.controllers.right.updateButtonValue('trigger', 0)")
    page.evaluate(NEXT_FRAMES)
    np.testing.assert_allclose(place(page), target if goes else [0, 0], atol=1e-6)


def test_a_scene_beyond_the_headsets_budget_is_thinned_for_it_alone(open_viewer, npm_package, until):
    page = open_viewer(WIDTH, HEIGHT, npm_package("iwer/build/iwer.min.js"), QUEST)
    whole = page.evaluate("() => spark.activeSplats")
    page.evaluate("() => { visit.budget = 2000; headset.click(); }")
    until(page, "spark.activeSplats <= 2000")
    assert page.evaluate("() => spark.activeSplats") > 1000  # as many as the budget has room for, about
    page.evaluate("() => headset.click()")
    until(page, f"!renderer.xr.isPresenting && viewer.settled() && spark.activeSplats === {whole}")
    page.context.close()


def test_leaving_shows_the_page_again_and_nothing_was_asked_of_a_network(page, until):
    page.evaluate("() => headset.click()")
    until(page, "!renderer.xr.isPresenting && viewer.settled()")
    assert page.evaluate("() => [headset.textContent, edge.visible, rig.position.length()]") == ["Enter VR", False, 0]
    assert page.complaints == []
    assert [url for url in page.requests if not url.startswith(("data:", "blob:"))] == page.requests[:1]
    page.locator("text=Enter VR").click(trial=True)  # nothing covers it
