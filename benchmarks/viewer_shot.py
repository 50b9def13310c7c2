"""Seconds of viewer.html to its first picture, in headless Chromium with OpenGL in software, and a screenshot.

    python -m benchmarks.viewer_shot runs/room/viewer.html benchmarks/results/viewer.jpg

Needs the extra `browser` and a Chromium. Writes the picture, the coarse scene beside the refined one from the same
place, and what was measured beside it as JSON.
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


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 1 where the page complains or does not come to rest."""
    parser = CommandParser("viewer_shot", __doc__, "benchmarks")
    parser.add_argument("page", type=Path)
    parser.add_argument("picture", type=Path)
    return parser.run(_run, arguments)


def _run(options) -> int:
    from playwright.sync_api import sync_playwright

    with sync_playwright() as engine:
        browser = engine.chromium.launch(args=list(FLAGS), executable_path=shutil.which("chromium"))
        page = browser.new_page(viewport={"width": SIZE[0], "height": SIZE[1]})
        complaints: list[str] = []
        page.on("console", lambda said: complaints.append(said.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        begun = time.monotonic()
        page.goto(options.page.resolve().as_uri(), wait_until="commit")
        _screenshot(page)
        first = time.monotonic() - begun
        page.evaluate("place => { Object.assign(viewer.here, place); viewer.redraw(); }", PLACE)
        pictures = [_shown(page, index) for index in (1, 2)]  # coarse, refined
        measured = {
            "seconds_to_first_picture": round(first, 2),
            "megabytes": round(options.page.stat().st_size / 1e6, 2),
            "viewport": SIZE,
            "browser": f"Chromium {browser.version}, SwiftShader",
            "complaints": complaints,
        }
        browser.close()
    cv2.imwrite(str(options.picture), np.hstack(pictures), [cv2.IMWRITE_JPEG_QUALITY, 85])
    options.picture.with_suffix(".json").write_text(json.dumps(measured, indent=1) + "\n")
    print(json.dumps(measured))
    return int(bool(complaints))


def _shown(page, index: int) -> np.ndarray:
    page.evaluate(f"() => viewer.show({index})")
    return _screenshot(page)


def _screenshot(page) -> np.ndarray:
    """The page's picture once it is complete: a screenshot waits for the GPU's process."""
    end = time.monotonic() + PATIENCE
    while not page.evaluate("() => !!globalThis.viewer && viewer.settled()"):
        if time.monotonic() > end:
            raise SystemExit(page.evaluate("() => document.body.innerText"))
        time.sleep(0.05)
    return cv2.imdecode(np.frombuffer(page.screenshot(), np.uint8), cv2.IMREAD_COLOR)


if __name__ == "__main__":
    sys.exit(main())
