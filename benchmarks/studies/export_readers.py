"""What others make of a run's exports: Khronos' glTF validator, splat-transform, and PlayCanvas in headless Chromium.

    (cd benchmarks/export_readers && npm ci)
    python -m benchmarks.studies.export_readers runs/room [--json benchmarks/results/export_readers.json]

PSNR of PlayCanvas' pictures of scene.glb and scene.sog beside our rasterizer's, at three places of a random walk; the
largest difference of scene.glb to the one that splat-transform makes of our PLY with Y down. Needs the extras `export`
and `browser`, a Chromium and Node 20.
"""

import functools
import http.server
import json
import math
import shutil
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from pathlib import Path

import cv2
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.export.__main__ import main as export
from experiments.export.walk import SafeArea, random_walk
from experiments.run_folder import RunFolder, open_run
from rein3d_jax.evaluate.metrics import psnr
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.meshes.surface_mesh import Y_UP_FROM_Z_UP
from rein3d_jax.io.pictures.image import to_uint8
from rein3d_jax.rasterize import render
from rein3d_jax.scene import Camera

READERS = Path(__file__).parents[1] / "export_readers"
FLAGS = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--no-sandbox")
SIZE, YAWS = 512, (0.0, 1.9, -2.4)
FRAMES, STILL = 10, 2_000  # sorted ones, and milliseconds, between two pictures that must be equal
PATIENCE = 120_000  # milliseconds
WIDTHS = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr."""
    parser = CommandParser("studies.export_readers", __doc__, "benchmarks")
    parser.add_argument("run", metavar="RUN_FOLDER")
    parser.add_argument("--json", type=Path)
    return parser.run(_measure, arguments)


def _measure(options) -> None:
    run = open_run(options.run)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        export([options.run, "--to", "gltf", "ply", "sog", "--up", "y-down", "--output", name])
        found = {"gltf_validator": _validated(folder), "splat_transform": _converted(folder)}
        found |= {"playcanvas_psnr": _shown(run, folder)}
    print(json.dumps(found, indent=1))
    if options.json:
        write_text(options.json, json.dumps(found, indent=1) + "\n")


def _validated(folder: Path) -> dict:
    files = [str(folder / name) for name in ("scene.glb", "mesh.glb")]
    said = subprocess.run(["node", READERS / "validate.mjs", *files], check=True, capture_output=True, text=True).stdout
    return {Path(each.pop("file")).name: each for each in json.loads(said)}


def _converted(folder: Path) -> dict[str, float]:
    """Largest difference by attribute; splat-transform keeps the order, and quaternions have either sign."""
    tool = READERS / "node_modules" / ".bin" / "splat-transform"
    subprocess.run([tool, "-q", folder / "scene.ply", folder / "theirs.glb"], check=True)
    ours, theirs = _attributes(folder / "scene.glb"), _attributes(folder / "theirs.glb")
    differences = {}
    for name in sorted(ours.keys() - {"COLOR_0"}):  # which splat-transform leaves in sRGB
        a, b = ours[name], theirs[name]
        b = b * np.sign(np.sum(a * b, axis=1, keepdims=True)) if name.endswith("ROTATION") else b
        differences[name.rpartition(":")[2]] = float(np.abs(a - b).max())
    return differences


def _attributes(path: Path) -> dict[str, np.ndarray]:
    data = path.read_bytes()
    end = 20 + int.from_bytes(data[12:16], "little")
    header, binary = json.loads(data[20:end]), data[end + 8 :]
    found = {}
    for name, index in header["meshes"][0]["primitives"][0]["attributes"].items():
        accessor = header["accessors"][index]
        view, width = header["bufferViews"][accessor["bufferView"]], WIDTHS[accessor["type"]]
        kind = "<f4" if accessor["componentType"] == 5126 else "u1"
        values = np.frombuffer(binary, kind, accessor["count"] * width, view["byteOffset"])
        found[name] = values.reshape(-1, width).astype(np.float64)
    return found


def _shown(run: RunFolder, folder: Path) -> dict[str, list[float]]:
    cameras = _cameras(run)
    wanted = [np.asarray(render(run.refined, camera, config=run.config.rasterize)[0].rgb) for camera in cameras]
    shutil.copy(READERS / "playcanvas.html", folder)
    shutil.copy(READERS / "node_modules" / "playcanvas" / "build" / "playcanvas.mjs", folder)
    found = {}
    for file in ("scene.glb", "scene.sog"):
        pictures = zip(_pictures(folder, file, cameras), wanted, strict=True)
        found[file] = [round(float(psnr(seen, to_uint8(ours) / 255)), 2) for seen, ours in pictures]
    return found


def _cameras(run: RunFolder) -> list[Camera]:
    places = random_walk(SafeArea(run), 80, 1)[[0, 35, 79]]
    poses = [upright(jnp.array([*place, 0.0]), yaw) for place, yaw in zip(places, YAWS, strict=True)]
    return [pinhole_camera(pose, SIZE, math.pi / 2) for pose in poses]


def _pictures(folder: Path, file: str, cameras: list[Camera]) -> Iterator[np.ndarray]:
    from playwright.sync_api import sync_playwright

    handler = functools.partial(_Silent, directory=str(folder))
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as engine:
        browser = engine.chromium.launch(args=list(FLAGS), executable_path=shutil.which("chromium"))
        page = browser.new_page(viewport={"width": SIZE, "height": SIZE})
        page.goto(f"http://127.0.0.1:{server.server_port}/playcanvas.html?file={file}&size={SIZE}")
        page.wait_for_function("() => window.loaded", timeout=PATIENCE)
        for camera in cameras:
            page.evaluate("columns => show(columns)", _gltf_pose(camera).T.ravel().tolist())
            yield cv2.imdecode(np.frombuffer(_still(page), np.uint8), cv2.IMREAD_COLOR)[..., ::-1] / 255
        browser.close()
    server.shutdown()


def _still(page) -> bytes:
    """A PNG of the canvas that stays the same: splats are sorted beside what is drawn, and come later."""
    last, shot = b"", None
    while shot != last:
        page.evaluate("() => { window.drawn = 0; }")
        page.wait_for_timeout(STILL)
        page.wait_for_function(f"() => window.drawn > {FRAMES}", timeout=PATIENCE)
        last, shot = shot, page.locator("canvas").screenshot()
    return shot


def _gltf_pose(camera: Camera) -> np.ndarray:
    """camera_to_world (4, 4) in glTF's axes, of the camera (x right, y up, z back) and of the world (Y up)."""
    pose = np.asarray(camera.world_from_camera, np.float64) @ np.diag([1.0, -1, -1, 1])
    pose[:3] = Y_UP_FROM_Z_UP @ pose[:3]
    return pose


class _Silent(http.server.SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


if __name__ == "__main__":
    sys.exit(main())
