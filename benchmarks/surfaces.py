"""Surfaces of a lifted scene: whether a wall is solid and plain from off the centre, and whether the photo comes back.

    python -m benchmarks.surfaces [--photo FILE [--distance FILE]] [--height 512] [--json FILE]

A box room of one colour, lifted and lined with its exact distance at shares 1, 0.5 and 0.25, is seen from 0.8 to 1.7 m
off the centre: mean and 1st percentile of alpha, and the ripple, 99th percentile of a picture less its 15 x 15 mean, in
grey levels of 255. A photo, lifted at its own size (its distance estimated where none is given), is seen from where it
was taken, over black: PSNR, the same weighed by area, and the share of its gradients' energy that is left.
"""

import argparse
import json
import sys
from pathlib import Path

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from rein3d_jax.evaluate.metrics import psnr, ws_psnr
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.panorama import read_panorama
from rein3d_jax.lift import LiftConfig, lift_adaptively, lining
from rein3d_jax.networks.depth import read_depth_network
from rein3d_jax.pipeline.buffer import joined_in
from rein3d_jax.pipeline.stages import Stages, level_pose, origin_pose
from rein3d_jax.pipeline.survey import with_distance
from rein3d_jax.rasterize import render
from rein3d_jax.scene import Gaussians, Panorama

SHARES = (1.0, 0.5, 0.25)
ROOM_ROWS = 256
WALLS = np.array([[2.6, 2.1, 1.1], [2.2, 1.8, 1.6]])  # metres ahead, left, above; behind, right, below
SHADE = 0.6
PLACES = ((0.8, 0.3, 0.0), (1.5, 0.8, 0.0), (1.2, -0.9, -0.5))
BARS = {"alpha": 0.995, "alpha_1%": 0.98, "ripple": 1.0}


def main(arguments: list[str] | None = None) -> int:
    """Prints a table. Exit code 0, or 2 where the input is at fault."""
    parser = CommandParser("surfaces", __doc__, package="benchmarks")
    parser.add_argument("--photo", type=Path, help="a panorama to see again from where it was taken")
    parser.add_argument("--distance", type=Path, help="its distance map")
    parser.add_argument("--height", type=int, default=512, help="rows it is lifted and seen at (%(default)s)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there")
    return parser.run(_run, arguments)


def _run(options: argparse.Namespace) -> None:
    room = one_colour_room()
    table = {f"room, share {share}": _solidity(_lifted(room, share)) for share in SHARES}
    if options.photo:
        photo = read_panorama(options.photo, distance=options.distance, height=options.height)
        photo, _ = with_distance(photo, Stages(), read_depth_network())
        table |= {f"{options.photo.name}, share {share}": _returned(photo, _lifted(photo, share)) for share in SHARES}
    for name, row in table.items():
        print(f"{name:28}  " + "  ".join(f"{key} {value:.4g}" for key, value in row.items()), flush=True)
    if options.json:
        about = {"places": PLACES, "bars": BARS, "height": options.height, "device": jax.devices()[0].device_kind}
        write_text(options.json, json.dumps(about | {"table": table}, indent=1) + "\n")


def one_colour_room() -> Panorama:
    """A box whose walls are all alike, with its exact distance."""
    ray = np.asarray(pixel_rays(ROOM_ROWS, 2 * ROOM_ROWS))
    distance = (np.where(ray > 0, *WALLS) / np.maximum(np.abs(ray), 1e-9)).min(-1).astype(np.float32)
    rgb = jnp.full((*distance.shape, 3), SHADE)
    return Panorama(rgb, jnp.asarray(distance), jnp.ones(distance.shape, bool))


def _lifted(panorama: Panorama, share: float) -> Gaussians:
    """The surfaces and their lining."""
    every, config = jnp.ones(panorama.distance.shape, bool), LiftConfig(share=share)
    surfaces = lift_adaptively(panorama.replace(valid=every), origin_pose(), every, config=config)
    return joined_in(surfaces, lining(panorama, origin_pose(), config=config), grow=True)[0]


def _solidity(scene: Gaussians) -> dict[str, float]:
    """The worst of all PLACES."""
    frames = [render(scene, equirectangular_camera(level_pose(jnp.array(place)), ROOM_ROWS))[0] for place in PLACES]
    alphas = [np.asarray(frame.alpha) for frame in frames]
    shades = [255 * np.asarray(frame.rgb[..., 1]) for frame in frames]
    return {
        "alpha": min(float(alpha.mean()) for alpha in alphas),
        "alpha_1%": min(float(np.percentile(alpha, 1)) for alpha in alphas),
        "ripple": max(float(np.percentile(np.abs(shade - cv2.blur(shade, (15, 15))), 99)) for shade in shades),
        "gaussians": int(scene.alive.sum()),
    }


def _returned(photo: Panorama, scene: Gaussians) -> dict[str, float]:
    frame, _ = render(scene, equirectangular_camera(origin_pose(), len(photo.rgb)))
    return {
        "psnr": float(psnr(frame.rgb, photo.rgb)),
        "ws_psnr": float(ws_psnr(frame.rgb, photo.rgb)),
        "gradients": _gradient_energy(frame.rgb) / _gradient_energy(photo.rgb),
        "alpha": float(frame.alpha.mean()),
        "gaussians": int(scene.alive.sum()),
    }


def _gradient_energy(image: jax.Array) -> float:
    """Mean squared steps between neighbours, each row by its area."""
    area = np.cos((np.arange(len(image)) + 0.5) / len(image) * np.pi - np.pi / 2)[:, None, None]
    down, right = (np.diff(np.asarray(image, np.float64), axis=axis) ** 2 for axis in (0, 1))
    return float((area * right).sum() + (area[1:] * down).sum())


if __name__ == "__main__":
    sys.exit(main())
