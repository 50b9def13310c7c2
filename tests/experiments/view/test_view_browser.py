"""The served walk in a real browser: scenes are fetched from the run's own server, and nothing from elsewhere."""

import shutil
import threading
import time

import pytest

from experiments.run_folder import open_run
from experiments.view.pages import pages
from experiments.view.server import server

playwright = pytest.importorskip("playwright.sync_api", reason="pip install 'rein3d-jax[browser]'")
# OpenGL in software, so that a machine without a display or GPU can
FLAGS = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox"]
PATIENCE = 240  # seconds; a picture takes 1 to 20 on a busy core


def until(page, condition):
    end = time.monotonic() + PATIENCE
    while not page.evaluate(f"() => {condition}"):
        assert time.monotonic() < end, page.evaluate("() => document.body.innerText")
        time.sleep(0.1)


def test_a_run_is_walked_through_in_a_browser(run_folder, tmp_path):
    folder = shutil.copytree(run_folder, tmp_path / "room")
    (folder / "metrics.json").write_text("{}")
    with server(pages(open_run(folder)), 0) as running, playwright.sync_playwright() as engine:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()
        try:
            try:
                browser = engine.chromium.launch(args=FLAGS, executable_path=shutil.which("chromium"))
            except playwright.Error as error:
                pytest.skip(f"no browser: apt install chromium ({str(error).splitlines()[0]})")
            page = browser.new_page(viewport={"width": 256, "height": 256})
            complaints, requests = [], []
            page.on("console", lambda said: complaints.append(said.text))
            page.on("pageerror", lambda error: complaints.append(str(error)))
            page.on("request", lambda request: requests.append(request.url))
            home = f"http://127.0.0.1:{running.server_port}/"
            page.goto(home, wait_until="commit")
            until(page, "!!globalThis.viewer && viewer.settled()")
            assert page.evaluate("() => viewer.here.shown") == 2  # panorama, coarse, refined
            page.keyboard.press("2")
            until(page, "viewer.here.shown === 1 && viewer.settled()")
            asked = [url for url in requests if not url.startswith(("data:", "blob:"))]
            assert asked == [home, f"{home}refined.spz", f"{home}coarse.spz"] and not complaints
            (folder / "scene.ply").unlink()
            page.reload(wait_until="commit")
            until(page, "document.getElementById('message')?.textContent.includes('could not be shown')")
            browser.close()
        finally:
            running.shutdown()
            thread.join()
