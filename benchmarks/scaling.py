"""Growth of the rasterizer's time with Gaussians, with pixels, and from a pinhole camera to a panorama."""

import json
import statistics
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.engines.ours import CONFIG, camera_of, scene_of
from benchmarks.workloads import Size, make_workload
from experiments.command import CommandParser
from rein3d_jax.geometry.poses import equirectangular_camera, upright
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.rasterize import allocate, rasterize
from rein3d_jax.scene import Gaussians

COUNTS = (30_000, 100_000, 300_000, 1_000_000, 3_000_000)
WIDTHS = (240, 424, 760, 1352, 2400)  # pictures of 43k to 4.3M pixels
ROUNDS = 7


def _seconds(scene, camera) -> tuple[float, int]:
    """Median wall seconds of a picture, and its (Gaussian, pixel) evaluations."""
    buffers = allocate(scene, [camera], config=CONFIG)
    frame = jax.block_until_ready(rasterize(scene, camera, config=CONFIG, buffers=buffers))
    pairs, times = int(frame.needed[2]), []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        jax.block_until_ready(rasterize(scene, camera, config=CONFIG, buffers=buffers))
        times.append(time.perf_counter() - started)
    return statistics.median(times), pairs * CONFIG.tile**2


def _slope(sizes, seconds) -> float:
    return float(np.polyfit(np.log(sizes), np.log(seconds), 1)[0])


def _room(count: int, width: int, scale: float):
    workload = make_workload(Size(count, scale, width, width * 3 // 4))
    return scene_of(workload), camera_of(workload)


def by_gaussians() -> dict:
    """Ever more Gaussians of the same 3 pixels in a picture of 640 x 480: evaluations grow in proportion."""
    rows = [_seconds(*_room(count, 640, 0.015)) for count in COUNTS]
    return _report("gaussians", COUNTS, rows)


def by_pixels() -> dict:
    """Ever more pixels, with a Gaussian in the scene for every 3 of them and a splat's size in pixels the same."""
    rows = [_seconds(*_room(width * (width * 3 // 4) // 3, width, 0.015 * 640 / width)) for width in WIDTHS]
    return _report("pixels", [width * (width * 3 // 4) for width in WIDTHS], rows)


def _report(name, sizes, rows) -> dict:
    seconds, evaluations = zip(*rows, strict=True)
    return {name: list(sizes), "seconds": seconds, "evaluations": evaluations, "slope": _slope(sizes, seconds)}


def lifted_panorama(height: int = 448) -> Gaussians:
    """One Gaussian a pixel on the walls of a room, round, as large as its pixel's footprint."""
    rays = np.asarray(pixel_rays(height, 2 * height)).reshape(-1, 3)
    distance = np.min(np.array([2.5, 2.0, 1.4]) / np.maximum(np.abs(rays), 1e-9), axis=1)
    count = len(rays)
    log_scales = np.log(0.5 * np.pi / height * distance)[:, None].repeat(3, axis=1)
    harmonics = np.random.default_rng(0).uniform(-1, 1, (count, 1, 3))
    quats = np.tile([1.0, 0, 0, 0], (count, 1))
    leaves = [jnp.asarray(x, jnp.float32) for x in (rays * distance[:, None], log_scales, quats)]
    return Gaussians(*leaves, jnp.full(count, 3.0), jnp.asarray(harmonics, jnp.float32), jnp.ones(count, bool))


def panorama_against_pinhole() -> dict:
    """A lifted panorama of 448 x 896 seen 10 cm off its centre, and a pinhole picture of as many evaluations: the
    scale of workload B's splats is searched for it."""
    camera = equirectangular_camera(upright(jnp.array([0.1, 0.05, 0.0])), 448)
    panorama, wanted = _seconds(lifted_panorama(), camera)
    scale, low, high = 0.03, 0.005, 0.1
    for _ in range(8):
        pinhole, evaluations = _seconds(*_room(400_000, 640, scale))
        if abs(evaluations / wanted - 1) < 0.05:
            break
        low, high = (scale, high) if evaluations < wanted else (low, scale)
        scale = (low * high) ** 0.5
    return {
        "panorama_s": panorama,
        "pinhole_s": pinhole,
        "ratio": panorama / pinhole,
        "panorama_evaluations": wanted,
        "pinhole_evaluations": evaluations,
    }


def main(arguments: list[str] | None = None) -> int:
    """Prints the slopes and the ratio."""
    parser = CommandParser("scaling", __doc__, "benchmarks")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    result = {"by_gaussians": by_gaussians(), "by_pixels": by_pixels(), "panorama": panorama_against_pinhole()}
    for name in ("by_gaussians", "by_pixels"):
        part = result[name]
        pairs = zip(part[name.removeprefix("by_")], part["seconds"], strict=True)
        times = ", ".join(f"{size}: {1e3 * seconds:.0f} ms" for size, seconds in pairs)
        print(f"{name.replace('_', ' ')}: slope {part['slope']:.2f}; {times}")
    part = result["panorama"]
    milliseconds = [f"{1e3 * part[key]:.0f} ms" for key in ("panorama_s", "pinhole_s")]
    print(f"panorama {milliseconds[0]}, pinhole {milliseconds[1]}: {part['ratio']:.2f} x")
    if options.json:
        write_text(Path(options.json), json.dumps(result, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
