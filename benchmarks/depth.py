"""Estimated distance against rooms with truth: AbsRel, the share within 1.25, how flat walls are.

The estimate that reconstruct takes beside the network alone and the fitted box.

    python -m benchmarks.depth ROOMS [--weights FOLDER] [--rendered FOLDER] [--height 128] [--box] [--pictures FOLDER]

ROOMS holds folders with input.png and input_distance.exr; every tenth room of a --rendered folder
(experiments.render_rooms) is never trained on. Pixels count by their solid angle, at the truth's own size.
"""

import argparse
import json
import sys
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.train_depth.data import as_floats
from experiments.train_depth.held_out import estimated_distance
from experiments.train_depth.rendered import RenderedRooms
from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.estimate import estimate_distance
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.evaluate.distance_error import distance_errors
from rein3d_jax.evaluate.standard_error import over_rooms
from rein3d_jax.geometry.pyramid import double
from rein3d_jax.geometry.shell import FACES, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import resize_panorama, write_rgb
from rein3d_jax.io.pictures.photo import read_rgb
from rein3d_jax.networks.depth import SHIPPED_DEPTH, read_depth_network
from rein3d_jax.scene import Panorama

FIGURES = "abs_rel", "within", "abs_rel_scaled", "within_scaled", "off_planes", "off_best_planes", "seconds"
_ON_PLANE = 0.02  # relative distance of the truth from its room's box
_FEWEST = 100  # pixels of a face
_CEILING = 4  # among RoomShell's faces


def network_distance(parameters: dict, rgb: np.ndarray, height: int) -> np.ndarray:
    """Distance over the camera's height (h, w) of a picture (h, w, 3), estimated at `height` rows."""
    small, _, _ = resize_panorama(rgb, None, None, height)
    log = jnp.log(estimated_distance(parameters, jnp.asarray(small), DepthNetworkConfig()))
    while len(log) < len(rgb):
        log = double(log)
    return np.exp(np.asarray(log))


def box_distance(rgb: np.ndarray) -> np.ndarray:
    """The fitted box's distance over the camera's height (h, w)."""
    shell, _ = fit_room_shell(jnp.asarray(rgb), 1.0, config=RoomShellConfig())
    return np.asarray(shell_distance(shell, *rgb.shape[:2]))


def traced_rooms(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """{name: (picture (h, w, 3), distance over the camera's height (h, w))} of rooms seen at eye height."""
    found = {}
    for room in sorted(path.parent for path in folder.glob("*/input_distance.exr")):
        rgb = read_rgb(room / "input.png")
        found[room.name] = rgb, read_distance(room / "input_distance.exr", rgb.shape[:2])[0] / EYE_HEIGHT
    return found


def rendered_rooms(folder: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """The same of the rendered panoramas that are held out."""
    held_out = map(as_floats, RenderedRooms(folder, 128, 10).held_out)
    return {f"rendered {number}": (example.rgb, example.distance) for number, example in enumerate(held_out)}


def main(arguments: list[str] | None = None) -> int:
    """Prints a table. Exit code 0, or 2 where the input is at fault."""
    parser = CommandParser("depth", __doc__, package="benchmarks")
    parser.add_argument("rooms", type=Path)
    parser.add_argument("--weights", type=Path, default=SHIPPED_DEPTH)
    parser.add_argument("--rendered", type=Path)
    parser.add_argument("--height", type=int, default=128, help="rows at which the network sees a picture")
    parser.add_argument("--box", action="store_true", help="the fitted box too, which takes some seconds a picture")
    parser.add_argument("--pictures", type=Path, help="folder for the picture, its true and its estimated distances")
    parser.add_argument("--json", type=Path, help="file for the figures of each room")
    return parser.run(_measure, arguments)


def _measure(options: argparse.Namespace) -> None:
    parameters = read_depth_network(options.weights)
    methods = {
        "estimate": lambda rgb: np.asarray(estimate_distance(jnp.asarray(rgb), parameters, 1.0).distance),
        "network": lambda rgb: network_distance(parameters, rgb, options.height),
    }
    methods |= {"box": box_distance} if options.box else {}
    sets = {"traced": traced_rooms(options.rooms)}
    sets |= {"rendered": rendered_rooms(options.rendered)} if options.rendered else {}
    told = {}
    for kind, examples in sets.items():
        rows = {name: _row(name, *pair, methods, options.pictures) for name, pair in examples.items()}
        for method in methods:
            mean, error, _ = over_rooms(jnp.array([row[method] for row in rows.values()]))
            print(f"MEAN of {len(rows)} {kind}: {method} {_told(mean)}\n  +- {_told(error)}", flush=True)
        told[kind] = {name: {m: _in_json(r) for m, r in row.items()} for name, row in rows.items()}
    if options.json:
        write_text(options.json, json.dumps(told, indent=1) + "\n")


def _in_json(row: list[float]) -> dict[str, float | None]:
    """JSON knows no NaN."""
    return {figure: None if np.isnan(x) else float(x) for figure, x in zip(FIGURES, row, strict=True)}


def _row(name: str, rgb: np.ndarray, true: np.ndarray, methods: dict, pictures: Path | None) -> dict[str, list[float]]:
    """The FIGURES of each method."""
    results, maps = {}, [true]
    for method, estimate in methods.items():
        begun = time.perf_counter()
        found = estimate(rgb)
        seconds = time.perf_counter() - begun
        maps.append(found)
        scale = np.median(true[true > 0] / found[true > 0])
        both = [distance_errors(jnp.asarray(found * s), true, true > 0) for s in (1, scale)]
        errors = [float(x) for e in both for x in (e.abs_rel, e.delta)]
        results[method] = [*errors, *off_planes(found, true), seconds]
    print(f"{name:12} " + "  ".join(f"{method} {_told(result)}" for method, result in results.items()), flush=True)
    if pictures:
        grey = [np.where(x > 0, np.clip(0.7 / np.maximum(x, 0.05), 0, 1), 0)[..., None] for x in maps]
        write_rgb(pictures / f"{name}.png", np.concatenate([rgb, *(np.repeat(x, 3, -1) for x in grey)]))
    return results


def off_planes(estimate: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Root mean square relative distance of walls and floor from the planes they truly lie on, and from the plane that
    fits each best; NaN where the truth is no box. Pixels over 10 % off, taken for a thing's, do not count."""
    panorama = Panorama(jnp.zeros((*true.shape, 3)), jnp.asarray(true), jnp.asarray(true > 0))
    shell, support = shell_from_distance(panorama)
    rays = np.asarray(pixel_rays(*true.shape))
    expected, face = map(np.asarray, meet_shell(shell, jnp.zeros(3), rays))
    off = estimate / np.maximum(true, 1e-6) - 1
    counts = (true > 0) & (np.abs(true / expected - 1) < _ON_PLANE) & (face != _CEILING) & (np.abs(off) < 0.1)
    counts &= np.bincount(face[counts], minlength=FACES)[face] >= _FEWEST  # a corner of a wall has no plane of its own
    if float(support) < 0.5 or not counts.any():
        return np.nan, np.nan
    area = np.asarray(pixel_solid_angles(*true.shape)) * counts
    from_best = np.zeros(true.shape)
    for number in np.unique(face[counts]):
        at = counts & (face == number)
        points, weights = rays[at] * estimate[at][:, None], area[at][:, None]
        points = points - np.sum(weights * points, axis=0) / np.sum(weights)
        _, _, axes = np.linalg.svd(np.sqrt(weights) * points, full_matrices=False)
        from_best[at] = points @ axes[2] / estimate[at]
    return tuple(float(np.sqrt(np.sum(area * x**2) / np.sum(area))) for x in (off * counts, from_best))


def _told(result: list[float]) -> str:
    return "AbsRel {:.3f} d1.25 {:.3f} | scaled {:.3f} {:.3f} | off planes {:.4f}, best {:.4f} | {:.1f}s".format(
        *result
    )


if __name__ == "__main__":
    sys.exit(main())
