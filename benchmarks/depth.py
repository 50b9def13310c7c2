"""Estimated distance against rooms with truth: the network beside the fitted box, AbsRel and the share within 1.25.

    python -m benchmarks.depth ROOMS [--weights FOLDER] [--rendered FOLDER] [--height 128] [--box] [--pictures FOLDER]

ROOMS holds folders with input.png and input_distance.exr; every tenth room of a --rendered folder
(experiments.render_rooms) is never trained on. Pixels count by their solid angle, at the truth's own size.
"""

import argparse
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
from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.room_shell import RoomShellConfig, fit_room_shell, shell_distance
from rein3d_jax.evaluate.distance_error import distance_errors
from rein3d_jax.geometry.pyramid import double
from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import read_rgb, resize_panorama, write_rgb
from rein3d_jax.networks.depth import SHIPPED_DEPTH, read_depth_network


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
    return parser.run(_measure, arguments)


def _measure(options: argparse.Namespace) -> None:
    parameters = read_depth_network(options.weights)
    methods = {"network": lambda rgb: network_distance(parameters, rgb, options.height)}
    methods |= {"box": box_distance} if options.box else {}
    sets = [traced_rooms(options.rooms), rendered_rooms(options.rendered) if options.rendered else {}]
    for examples in filter(None, sets):
        rows = [_row(name, *pair, methods, options.pictures) for name, pair in examples.items()]
        for number, method in enumerate(methods):
            mean = np.mean([row[number] for row in rows], axis=0)
            print(f"MEAN of {len(rows)}: {method} {_figures(mean)}", flush=True)


def _row(name: str, rgb: np.ndarray, true: np.ndarray, methods: dict, pictures: Path | None) -> list[np.ndarray]:
    """Of each method: AbsRel, share within 1.25, both after one scale, seconds."""
    results, maps = [], [true]
    for estimate in methods.values():
        begun = time.perf_counter()
        maps.append(estimate(rgb))
        seconds = time.perf_counter() - begun
        scale = np.median(true[true > 0] / maps[-1][true > 0])
        both = [distance_errors(jnp.asarray(maps[-1] * s), true, true > 0) for s in (1, scale)]
        results.append(np.array([float(x) for e in both for x in (e.abs_rel, e.delta)] + [seconds]))
    told = "  ".join(f"{method} {_figures(result)}" for method, result in zip(methods, results, strict=True))
    print(f"{name:12} {told}", flush=True)
    if pictures:
        grey = [np.where(x > 0, np.clip(0.7 / np.maximum(x, 0.05), 0, 1), 0)[..., None] for x in maps]
        write_rgb(pictures / f"{name}.png", np.concatenate([rgb, *(np.repeat(x, 3, -1) for x in grey)]))
    return results


def _figures(result: np.ndarray) -> str:
    return "AbsRel {:.3f} d1.25 {:.3f} | scaled {:.3f} {:.3f} {:.1f}s".format(*result)


if __name__ == "__main__":
    sys.exit(main())
