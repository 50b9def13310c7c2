"""How soon viewer.html shows its first picture, how fluidly it turns, whether it can be read aloud and worn; a picture.

Headless Chromium with OpenGL in software: seconds to the first picture and to a sharp one after a jump, frames a second
while turning; what axe finds; eyes and frames in an emulated headset.

    (cd benchmarks/viewer_build && npm ci)
    python -m benchmarks.viewer_shot runs/room/viewer.html benchmarks/results/viewer.jpg

Needs the extra `browser` and a Chromium, and the npm packages of benchmarks/viewer_build. Writes the picture, the
coarse scene beside the refined one from the same place, and what was measured beside it as JSON.
"""

import json
import shutil
import sys
import time
from pathlib import Path

import cv2
import numpy as np

from experiments.command import CommandParser

SIZE = (800, 500)
PLACE = {"x": 0.8, "y": -1.2, "yaw": 1.9, "pitch": -0.1}  # in the sample room, 1.4 m from the panorama
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox")
PATIENCE = 300  # seconds
PACKAGES = Path(__file__).parent / "viewer_build" / "node_modules"
HEADSET = """globalThis.device = new IWER.XRDevice(IWER.metaQuest3);
device.installRuntime({ forceInstall: true }); device.stereoEnabled = true;"""
TURNING = """async (seconds) => {
    const { held } = viewer, before = renderer.info.render.frame, begun = performance.now();
    held.add("turnLeft");
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    held.delete("turnLeft");
    return (1000 * (renderer.info.render.frame - before)) / (performance.now() - begun);
}"""
VISIT = """async (seconds) => {
    const { frame } = renderer.info.render, begun = performance.now();
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    const drawn = renderer.info.render.frame - frame, took = performance.now() - begun;
    return { eyes: renderer.xr.getCamera().cameras.length, frames_a_second: (1000 * drawn) / took };
}"""


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 1 where the page complains or does not come to rest."""
    parser = CommandParser("viewer_shot", __doc__, "benchmarks")
    parser.add_argument("page", type=Path)
    parser.add_argument("picture", type=Path)
    return parser.run(_run, arguments)


def _run(options) -> int:
    from playwright.sync_api import sync_playwright

    complaints: list[str] = []
    with sync_playwright() as engine:
        browser = engine.chromium.launch(args=list(FLAGS), executable_path=shutil.which("chromium"))
        begun = time.monotonic()
        page = _opened(browser, options.page, complaints)
        first = time.monotonic() - begun
        frames = page.evaluate(TURNING, 5)
        _screenshot(page)
        begun = time.monotonic()
        page.evaluate("place => { Object.assign(viewer.here, place); viewer.redraw(); }", PLACE)
        _screenshot(page)
        measured = {
            "seconds_to_first_picture": round(first, 2),
            "seconds_to_a_sharp_picture_after_a_jump": round(time.monotonic() - begun, 2),
            "frames_a_second_while_turning": round(frames, 1),
            "splats": page.evaluate("() => spark.activeSplats"),
            "megabytes": round(options.page.stat().st_size / 1e6, 2),
            "viewport": SIZE,
            "browser": f"Chromium {browser.version}, SwiftShader",
            "axe": _axe(page),
            "headset": _headset(browser, options.page, complaints),
        }
        pictures = [_shown(page, index) for index in (1, 2)]  # coarse, refined
        browser.close()
    measured["complaints"] = complaints
    cv2.imwrite(str(options.picture), np.hstack(pictures), [cv2.IMWRITE_JPEG_QUALITY, 85])
    options.picture.with_suffix(".json").write_text(json.dumps(measured, indent=1) + "\n")
    print(json.dumps(measured))
    return int(bool(complaints))


def _opened(browser, path: Path, complaints: list[str], *scripts: str):
    """The page once its first picture is complete."""
    page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
    page.on("console", lambda said: complaints.append(said.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    for script in scripts:
        page.add_init_script(script)
    page.goto(path.resolve().as_uri(), wait_until="commit")
    _screenshot(page)
    return page


def _axe(page) -> dict[str, int]:
    """How many of axe's rules the page meets and fails."""
    page.evaluate((PACKAGES / "axe-core" / "axe.min.js").read_text("utf-8"))
    return page.evaluate("async () => { const { passes, violations } = await axe.run(); "
                         "return { passes: passes.length, violations: violations.length }; }")  # fmt: skip


def _headset(browser, path: Path, complaints: list[str]) -> dict[str, float]:
    """Eyes and frames a second in Meta's emulator of a Quest 3, both eyes together of SIZE."""
    emulator = (PACKAGES / "iwer" / "build" / "iwer.min.js").read_text("utf-8")
    page = _opened(browser, path, complaints, emulator, HEADSET)
    page.locator("text=Enter VR").click()
    _await(page, "renderer.xr.isPresenting && edge.visible")
    seen = page.evaluate(VISIT, 5)
    page.close()
    return {name: round(value, 1) for name, value in seen.items()}


def _shown(page, index: int) -> np.ndarray:
    page.evaluate(f"() => viewer.show({index})")
    return _screenshot(page)


def _screenshot(page) -> np.ndarray:
    """The page's picture once it is complete: a screenshot waits for the GPU's process."""
    _await(page, "!!globalThis.viewer && viewer.settled()")
    return cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)


def _await(page, condition: str) -> None:
    end = time.monotonic() + PATIENCE
    while not page.evaluate(f"() => {condition}"):
        if time.monotonic() > end:
            raise SystemExit(page.evaluate("() => document.body.innerText"))
        time.sleep(0.05)


if __name__ == "__main__":
    sys.exit(main())
