"""The report in a real browser, from disk: it asks for nothing, complains of nothing, and its dividers move."""

import shutil

import numpy as np
import pytest

from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.report.report import Comparison, Picture, Report, render_report
from rein3d_jax.report.scatter import Mark, Scatter

playwright = pytest.importorskip("playwright.sync_api", reason="pip install 'rein3d-jax[browser]'")
HOSTILE = "</title><script>globalThis.hacked = 1</script><img src=x onerror='globalThis.hacked = 1'>"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    """The page, open; what it complained of and asked for."""
    dark, light = (Picture(HOSTILE, encode_jpeg(np.full((64, 128, 3), shade))) for shade in (0.0, 1.0))
    report = Report(
        HOSTILE, HOSTILE, parts=(Comparison(HOSTILE, HOSTILE, dark, light, (light,)),),
        standing=Scatter(HOSTILE, HOSTILE, HOSTILE, HOSTILE, (Mark(HOSTILE, 3.0, 20.0),)), sources=(HOSTILE,),
    )  # fmt: skip
    path = tmp_path_factory.mktemp("report") / "report.html"
    path.write_text(render_report(report), encoding="utf-8")
    with playwright.sync_playwright() as engine:
        try:
            browser = engine.chromium.launch(args=["--no-sandbox"], executable_path=shutil.which("chromium"))
        except playwright.Error as error:
            pytest.skip(f"no browser: apt install chromium, or playwright install chromium ({error})".splitlines()[0])
        opened = browser.new_page(viewport={"width": 900, "height": 600})
        opened.complaints, opened.requests = [], []
        opened.on("console", lambda said: opened.complaints.append(f"{said.type}: {said.text}"))
        opened.on("pageerror", lambda error: opened.complaints.append(str(error)))
        opened.on("request", lambda request: opened.requests.append(request.url))
        opened.goto(path.as_uri())
        yield opened
        browser.close()


def test_it_asks_for_nothing_and_complains_of_nothing(page):
    assert [url for url in page.requests if not url.startswith("data:")] == page.requests[:1]
    assert page.complaints == []


def test_hostile_texts_are_text(page):
    assert page.evaluate("() => [document.title, globalThis.hacked ?? null]") == [HOSTILE, None]
    assert page.evaluate("() => document.querySelector('h2').textContent") == HOSTILE
    assert page.evaluate("() => document.scripts.length") == 0


def test_every_picture_is_shown(page):
    sizes = page.evaluate("() => [...document.images].map(i => [i.complete, i.naturalWidth])")
    assert sizes == [[True, 128]] * 3


def test_a_divider_moves_by_keyboard_and_by_drag(page):
    where = "() => document.querySelector('.slider').style.getPropertyValue('--x')"
    page.focus(".slider input")
    page.keyboard.press("End")
    assert page.evaluate(where) == "100%"
    box = page.locator(".slider").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 4, box["y"] + box["height"] / 2)
    assert float(page.evaluate(where).rstrip("%")) == pytest.approx(25, abs=3)  # the thumb has a width
