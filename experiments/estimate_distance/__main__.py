"""The distance of a panorama that has none, as a file.

    python -m experiments.estimate_distance --input pano.jpg --output distance.exr [--json FILE] [--set KEY=VALUE ...]

Writes metres along each ray at the picture's own size (one float32 channel, Y; 0 where unknown), and a picture of it
beside it, distance_colours.png. Where the picture leaned, the distance is the levelled picture's, which is written too,
distance_level.png; input.level = false keeps it as it came. The keys are those of reconstruct, of which input, depth
and shell count; with input.distance, that map is written as metres along the ray, converted and scaled as reconstruct
would take it.
"""

import argparse
import json
import time
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.config import load_config, toml_value
from experiments.quick_process import begin_quickly, end_quickly
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.inputs import resolve, told_panorama
from rein3d_jax.depth.level import LEANED, levelled
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.io.pictures.panorama import read_panorama
from rein3d_jax.io.pictures.photo import panorama_rows
from rein3d_jax.networks.depth import read_depth_network
from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.pipeline.survey import with_distance
from rein3d_jax.report.colour_map import colour_map, colour_range
from rein3d_jax.upsample import distance_for


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    begin_quickly()
    parser = CommandParser("estimate_distance", __doc__)
    parser.add_argument("--input", metavar="FILE", required=True, help="an equirectangular JPEG, PNG, EXR or HDR (2:1)")
    parser.add_argument("--output", metavar="FILE", required=True, help="the distance to write, ending in .exr")
    parser.add_argument("--json", metavar="FILE", help="where to write seconds, scale and what is unknown")
    parser.add_recipe(ReconstructConfig, default="quick")
    return parser.run(_estimate, arguments)


def _estimate(options: argparse.Namespace) -> None:
    begun, output = time.perf_counter(), Path(options.output)
    if output.suffix.lower() != ".exr":
        raise InputError(f"--output {output}: the distance is written as EXR; let its name end in .exr")
    if output.resolve() == Path(options.input).resolve():
        raise InputError(f"--output {output} is the picture itself: choose another name")
    given = [f"input.panorama={toml_value(options.input)}", "input.distance=none", "input.views=none"]
    given.append("input.upsample=none")  # its guessed detail says nothing of distance
    config = load_config(ReconstructConfig, options.config, given + options.set)
    rows = panorama_rows(resolve(config.input.panorama))  # a picture that is none is refused before the long part
    network = read_depth_network(config.depth_weights) if config.asks_network else None
    panorama, told, lean = told_panorama(config.input, read_upsampler(config.input.upsample))
    placed, estimated = with_distance(panorama, config, network, camera_height=config.input.eye_height)
    picture = levelled(read_panorama(resolve(config.input.panorama)), lean).rgb
    distance = np.asarray(distance_for(picture, jnp.where(placed.valid, placed.distance, 0.0)))
    write_distance_exr(output, distance)
    known = distance > 0
    write_rgb(
        output.with_name(f"{output.stem}_colours.png"), colour_map(distance, known, *colour_range(distance, known))
    )
    if lean.verdict == LEANED:
        write_rgb(output.with_name(f"{output.stem}_level.png"), np.asarray(picture))
    facts = {
        "distance": str(output),
        "size": [2 * rows, rows],
        "worked_at": [2 * len(panorama.rgb), len(panorama.rgb)],
        "method": config.depth.method if estimated else "given",
        "converted": told,
        "lean": lean.sentence,
        "camera_height": config.input.eye_height,
        "camera_height_given": config.input.camera_height is not None,
        "unknown": round(float(np.mean(distance == 0)), 4),
        "seconds": round(time.perf_counter() - begun, 3),
    }
    if options.json:
        write_text(options.json, json.dumps(facts, indent=2) + "\n")
    print(_line(facts))


def _line(facts: dict) -> str:
    height = f"{facts['camera_height']} m" + ("" if facts["camera_height_given"] else ", a guess: input.camera_height")
    return f"{facts['distance']}: {facts['method']}, camera at {height}, {facts['seconds']} s"


if __name__ == "__main__":
    end_quickly(main())
