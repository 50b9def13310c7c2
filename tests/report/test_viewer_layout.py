"""The viewer's page from a phone to a 4K screen: all of it is on the screen, nothing covers anything, every control can
be reached, by eye, finger, keyboard and screen reader."""

import itertools
import json

import pytest

SCREENS = {
    "phone": ((360, 640), True),
    "phone on its side": ((640, 360), True),
    "tablet": ((820, 1180), True),
    "laptop": ((1366, 768), False),
    "4K": ((3840, 2160), False),
}
PARTS = "#top, #map, #pad, #tools, details, #bottom p, button"
BOXES = """(parts) => Object.fromEntries([...document.querySelectorAll(parts)]
    .map((each, i) => [`${i} ${each.id || each.textContent}`, each]).filter(([, each]) => each.checkVisibility())
    .map(([name, each]) => { const { left, top, right, bottom } = each.getBoundingClientRect();
        const there = document.elementFromPoint((left + right) / 2, (top + bottom) / 2);
        return [name, { box: [left, top, right, bottom], button: each.matches('button'), hit: there === each }]; }))"""
FINGER = 40  # pixels a side; WCAG 2.2 asks for 24


@pytest.fixture(scope="module", params=SCREENS)
def screen(request, open_viewer):
    """The page, and whether it is touched, on a screen of one kind."""
    (width, height), touch = SCREENS[request.param]
    page = open_viewer(width, height, has_touch=touch, is_mobile=touch)
    yield page, touch
    page.context.close()


def test_all_is_on_the_screen_and_nothing_covers_anything(screen):
    page, _ = screen
    width, height, wide = page.evaluate("() => [innerWidth, innerHeight, document.documentElement.scrollWidth]")
    found = page.evaluate(BOXES, PARTS)
    assert wide <= width
    for name, each in found.items():
        left, top, right, bottom = each["box"]
        assert left >= 0 and top >= 0 and right <= width and bottom <= height, name
    parts = {name: each["box"] for name, each in found.items() if not each["button"]}
    for (one, a), (other, b) in itertools.combinations(parts.items(), 2):
        apart = a[2] <= b[0] or b[2] <= a[0] or a[3] <= b[1] or b[3] <= a[1]
        assert apart, (one, other)


def test_every_button_can_be_reached(screen):
    page, touch = screen
    buttons = {name: each for name, each in page.evaluate(BOXES, PARTS).items() if each["button"]}
    assert len(buttons) == (8 if touch else 4)  # two views, two tools, and the pad
    for name, each in buttons.items():
        left, top, right, bottom = each["box"]
        assert each["hit"], name
        assert min(right - left, bottom - top) >= (FINGER if touch else 24), name


def test_axe_finds_nothing_to_mend(screen, npm_package):
    page, _ = screen
    page.evaluate(npm_package("axe-core/axe.min.js"))
    found = page.evaluate("() => axe.run()")
    assert found["passes"] and not found["violations"], json.dumps(found["violations"], indent=1)[:4000]


def test_the_pad_walks_without_a_pointer(screen):
    """As a screen reader presses it: one step, along where one looks."""
    page, touch = screen
    if not touch:
        pytest.skip("no pad beside a mouse")
    page.evaluate("() => Object.assign(viewer.here, { x: 0, y: 0, yaw: 0, shown: 1 })")
    page.evaluate("() => document.querySelector('#pad [aria-label=\"Walk forward\"]').click()")
    assert page.evaluate("() => [viewer.here.x, viewer.here.y]") == [pytest.approx(0.3), 0]
