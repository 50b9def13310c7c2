"""Figures of where methods of this kind fail, each a regime of its own.

    python -m benchmarks.stability [--rows 7,9] [--json benchmarks/results/stability.json]

Tiny box rooms in closed form are seen from the origin and from places around it, lifted and refined. No figure is tuned
to look well. Rows are numbered as in the list of failures that they were drawn up from.
"""

import json
import sys
import time
from collections import deque
from dataclasses import asdict, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.studies.box_room import (
    BOX,
    HEIGHT,
    MIRROR,
    Paint,
    lifted,
    mirrored,
    pattern,
    pose_at,
    true_panorama,
    views_of,
    white,
)
from experiments.command import CommandParser
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.shell import meet_shell, world_from_shell
from rein3d_jax.geometry.sphere import pixel_rays, rays_of_pose
from rein3d_jax.geometry.spherical_harmonics import C0
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize, render
from rein3d_jax.refine import Curves, DensifyConfig, RefineConfig, Views, ViewsConfig, first_snapshot, refine
from rein3d_jax.refine.views import camera_of
from rein3d_jax.scene import Gaussians

# Evaluated, never fitted to.
NOVEL = [0.5 * np.array([np.cos(a), np.sin(a), 0.4 * np.cos(2 * a)]) for a in 0.5 + np.arange(3) * 2.1]
EXTENT = 2.0  # metres, about the median distance
RASTER = RasterizeConfig()
BUFFERS = Buffers(visible=4096, rows=16384, pairs=32768, chunks=2048)
CONFIG = RefineConfig(
    steps=240, batch=2, evaluate_every=1000, sh_degree=1, sh_degree_every=100,
    views=ViewsConfig(size=32, held_out_every=8),
    densify=DensifyConfig(start=50, stop=200, every=50, reset_every=1000),
)  # fmt: skip
KEY = jax.random.key(0)


def seen_from(scene: Gaussians, places) -> list[tuple[np.ndarray, np.ndarray]]:
    """(rgb over black, distance) of panoramas of the scene."""
    frames, buffers = [], BUFFERS
    for place in places:
        camera = equirectangular_camera(pose_at(place), HEIGHT)
        frame, buffers = render(scene, camera, config=RASTER, buffers=buffers)
        frames.append((np.clip(frame.rgb, 0, 1), np.asarray(frame.distance)))
    return frames


def everywhere(face: jax.Array, points: jax.Array) -> jax.Array:
    """(h, w) bool of a picture's faces (h, w) and points (h, w, 3)."""
    return face >= 0


def in_front(face: jax.Array, points: jax.Array) -> jax.Array:
    """What the input saw, where it did not see the third behind: less than 120 degrees from the world's +X."""
    return jnp.abs(jnp.arctan2(points[..., 1], points[..., 0])) < 2 * jnp.pi / 3


def errors_of(scene: Gaussians, paint: Paint, region=everywhere) -> np.ndarray:
    """(n, 3) of the pixels of `region` at NOVEL."""
    errors = []
    for (rgb, _), place in zip(seen_from(scene, NOVEL), NOVEL, strict=True):
        truth, distance, face = true_panorama(place, paint)
        points = place + distance[..., None] * rays_of_pose(pose_at(place), *face.shape)
        errors.append((rgb - np.clip(truth, 0, 1))[np.asarray(region(face, points))])
    return np.concatenate(errors)


def decibels(scene: Gaussians, paint: Paint, region=everywhere) -> float:
    """PSNR of the pixels of `region` at NOVEL."""
    return float(-10 * np.log10(np.mean(errors_of(scene, paint, region) ** 2)))


def fit(scene: Gaussians, views: Views, config: RefineConfig, extent: float = EXTENT) -> tuple[Gaussians, Curves]:
    """`refine`, from the same key and in the same buffers always."""
    start = first_snapshot(scene, views, extent=extent, config=config, raster=RASTER)
    start = start.replace(buffers=jnp.array(BUFFERS.enlarged(start.buffers)))
    (last,) = deque(refine(start, views, KEY, config=config, raster=RASTER), maxlen=1)
    assert all(np.all(np.isfinite(leaf)) for leaf in jax.tree.leaves(last.scene)), "not finite"
    return last.scene, last.curves


def scale_of_depth() -> dict:
    """Row 7: everything in other units, lifted, and refined for 20 steps without densification. From the origin many
    Gaussians are equally far, and a factor that is no power of 2 rounds them into another order."""
    pictures = {unit: pictures_in(unit) for unit in (1.0, 0.125, 0.1, 10.0)}
    row = {}
    for unit in (0.125, 0.1, 10.0):
        for key, picture in pictures[unit].items():
            change = np.abs(picture - pictures[1.0][key])
            row |= {f"{key}_max_at_{unit}": float(change.max()), f"{key}_mean_at_{unit}": float(change.mean())}
    moved = np.abs(pictures[1.0]["refined_elsewhere"] - pictures[1.0]["lifted_elsewhere"])
    return row | {"refining_changed_max": float(moved.max()), "refining_changed_mean": float(moved.mean())}


def pictures_in(unit: float) -> dict[str, np.ndarray]:
    """The lifted and the refined scene, seen from the origin and from elsewhere."""
    scene, views = lifted(pattern, unit=unit), views_of(pattern, CONFIG.views, unit=unit)
    fitted, _ = fit(scene, views, replace(CONFIG, steps=20), unit * EXTENT)
    found = {}
    for place, some in (("origin", range(6)), ("elsewhere", range(6, len(views.rgb), 3))):
        for name, g in (("lifted", scene), ("refined", fitted)):
            cameras = [camera_of(views, index) for index in some]
            frames = [rasterize(g, camera, config=RASTER, buffers=BUFFERS).rgb for camera in cameras]
            found[f"{name}_{place}"] = np.stack(frames)
    return found


def mirror_room() -> dict:
    """Row 9: one wall is a mirror, lifted where its glass is; the fitted views show what it truly shows."""
    scene, views, row = lifted(mirrored, spare=1.0), views_of(mirrored, CONFIG.views), {}
    regions = {"mirror": lambda face, _: face == MIRROR, "rest": lambda face, _: face != MIRROR}
    row["capacity"], row["lifted_count"] = scene.alive.size, int(scene.alive.sum())
    row |= {f"lifted_psnr_{name}": decibels(scene, mirrored, region) for name, region in regions.items()}
    for name in ("default", "mcmc"):
        config = replace(CONFIG, densification=name)
        if name == "mcmc":
            config = replace(config, loss=replace(config.loss, opacity=0.01, scale=0.01))
        fitted, curves = fit(scene, views, config)
        row |= {f"{name}_count": int(fitted.alive.sum()), f"{name}_overflow": int(curves.overflow)}
        row |= {f"{name}_count_behind_glass": behind_glass(fitted)}
        row |= {f"{name}_psnr_{where}": decibels(fitted, mirrored, region) for where, region in regions.items()}
    return row


def behind_glass(scene: Gaussians) -> int:
    """Gaussians more than 5 % of the distance behind the mirror."""
    depth = scene.means @ world_from_shell(BOX)[:, 0]
    return int(jnp.sum(scene.alive & (depth > 1.05 * BOX.walls[MIRROR])))


def white_room() -> dict:
    """Row 10: one flat colour, lifted with exact distances and with ones that are off by 10 %."""
    row, views = {}, views_of(white, CONFIG.views)
    for name, noise in (("exact", 0.0), ("noisy", 0.1)):
        scene = lifted(white, noise=noise)
        fitted, _ = fit(scene, views, CONFIG)
        for when, g in (("lifted", scene), ("refined", fitted)):
            row |= {
                f"{name}_{when}_mass_off_surface": off_surface(g),
                f"{name}_{when}_distance_rmse": distance_error(g),
            }
        row |= {f"{name}_psnr": decibels(fitted, white), f"{name}_count": int(fitted.alive.sum())}
    return row


def off_surface(scene: Gaussians) -> float:
    """Share of opacity x area that lies more than 5 % of the distance away from the wall."""
    away = jnp.linalg.norm(scene.means, axis=-1)
    wall, _ = meet_shell(BOX, jnp.zeros(3), scene.means / jnp.maximum(away, 1e-6)[:, None])
    first, second, _ = jnp.sort(jnp.exp(scene.log_scales), axis=-1)[:, ::-1].T
    mass = jnp.where(scene.alive, jax.nn.sigmoid(scene.opacity_logits) * first * second, 0.0)
    return float(jnp.sum(mass * (jnp.abs(away / wall - 1) > 0.05)) / jnp.sum(mass))


def distance_error(scene: Gaussians) -> float:
    """Metres: RMSE of rendered distances at places that nothing was fitted to."""
    pairs = zip(seen_from(scene, NOVEL), NOVEL, strict=True)
    errors = [(distance - np.asarray(true_panorama(place, white)[1])) ** 2 for (_, distance), place in pairs]
    return float(np.sqrt(np.mean(errors)))


def opacity_resets() -> dict:
    """Row 11: a reset every 200 steps; held-out PSNR and count before, lowest, and at the end of the 200 steps."""
    every, step = 200, 20
    times = DensifyConfig(start=100, stop=700, every=100, reset_every=every)
    config = replace(CONFIG, steps=800, evaluate_every=step, densify=times)
    _, curves = fit(lifted(pattern), views_of(pattern, CONFIG.views), config)
    row = {"start_psnr": curves.psnr[0, 1], "final_psnr": curves.psnr[-1, 1]}
    for name in ("psnr", "count"):
        at = dict(getattr(curves, name))
        for reset in range(every, 700, every):  # the evaluation at `reset` comes after it
            row[f"{name}_before_{reset}"] = at[reset - step]
            row[f"{name}_least_after_{reset}"] = min(at[number] for number in range(reset, reset + every, step))
            row[f"{name}_at_end_after_{reset}"] = at[reset + every - step]
    return row


def tiny_buffer() -> dict:
    """Row 12: nearly all want to grow, into 64 free slots."""
    scene = lifted(pattern, spare=1 / 32)
    eager = replace(CONFIG, densify=replace(CONFIG.densify, gradient=1e-7), evaluate_every=50)
    fitted, curves = fit(scene, views_of(pattern, CONFIG.views), eager)
    return {
        "capacity": scene.alive.size, "lifted_count": int(scene.alive.sum()), "count": int(fitted.alive.sum()),
        "most": int(curves.count[:, 1].max()), "overflow": int(curves.overflow),
        "lifted_psnr": decibels(scene, pattern), "psnr": decibels(fitted, pattern),
    }  # fmt: skip


def tints() -> dict:
    """Row 25: source 1 is the truth, source 2 redder and less blue by 0.12, and what the input did not see, the third
    behind, was filled with source 2's. PSNR to the truth, and what is left of the tint: mean red less mean blue error.
    """
    front = in_front(None, pixel_rays(HEIGHT, 2 * HEIGHT))
    tint = (jnp.zeros(3), jnp.zeros(3), jnp.array([0.12, 0.0, -0.12]))
    scene = lifted(pattern)
    guessed = jnp.pad(~front.ravel(), (0, scene.alive.size - front.size))
    scene = scene.replace(sh=scene.sh + jnp.where(guessed[:, None, None], tint[2] / C0, 0.0))
    row = tint_left(scene, "before")
    for weight in (1.0, 0.5):
        views = views_of(
            pattern, CONFIG.views, tint=lambda s: tint[s], weight=lambda s, w=weight: w if s else front.astype(float)
        )
        fitted, _ = fit(scene, views, CONFIG)
        row |= tint_left(fitted, f"weight_{weight}")
    return row


def tint_left(scene: Gaussians, name: str) -> dict:
    """Figures of the third that the input did not see, and of the rest."""
    row = {}
    for where, side in (("seen", in_front), ("unseen", lambda *x: ~in_front(*x))):
        error = errors_of(scene, pattern, side)
        row[f"{name}_{where}_psnr"] = float(-10 * np.log10(np.mean(error**2)))
        row[f"{name}_{where}_tint"] = float(np.mean(error[:, 0] - error[:, 2]))
    return row


ROWS = {
    "7 scale of depth": scale_of_depth,
    "9 mirror": mirror_room,
    "10 white walls": white_room,
    "11 opacity reset": opacity_resets,
    "12 tiny buffer": tiny_buffer,
    "25 tints that disagree": tints,
}


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a row."""
    parser = CommandParser("stability", __doc__, "benchmarks")
    parser.add_argument("--rows", default=",".join(name.split()[0] for name in ROWS), help="numbers, comma-separated")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    table = {}
    for name, measure in ROWS.items():
        if name.split()[0] not in options.rows.split(","):
            continue
        start = time.perf_counter()
        found = measure() | {"seconds": time.perf_counter() - start}
        table[name] = {key: x if isinstance(x, int) else float(f"{x:.4g}") for key, x in found.items()}
        print(name, table[name], flush=True)
    if options.json:
        report = {"height": HEIGHT, "refine": asdict(CONFIG), "rows": table}
        write_text(Path(options.json), json.dumps(report, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
