"""The main job: one panorama in, one explorable scene out.

    python -m experiments.reconstruct [pano.jpg] [--config quick] [--distance depth.exr] [--output runs/room]
        [--set stage.key=value ...] [--resume]

Writes scene.ply, viewer.html, flythrough.mp4, report.html, metrics.json and config.toml into the output folder, and
each finished stage into its `stages` folder, from which --resume goes on.
"""

import argparse

from experiments.command import CommandParser
from experiments.config import load_config, toml_value
from experiments.quick_process import begin_quickly, end_quickly
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.job import run_job
from rein3d_jax.errors import InputError


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0; with one line on stderr 2 where the input or the machine is at fault, or 130 after Ctrl-C."""
    begin_quickly()
    parser = CommandParser("reconstruct", __doc__)
    parser.lighter = "lower input.height, lift.share or budget.gaussians"
    parser.add_argument("panorama", nargs="?", metavar="PANORAMA", help="the same as --input")
    parser.add_argument("--input", metavar="FILE", help="an equirectangular JPEG, PNG, EXR or HDR (2:1)")
    parser.add_argument("--distance", metavar="FILE", help="metres along each ray: EXR, 16-bit PNG (mm), NPY or NPZ")
    parser.add_argument("--output", metavar="FOLDER", help="where to write (default: the recipe's)")
    parser.add_argument("--resume", action="store_true", help="go on after the last finished stage of this very job")
    parser.add_recipe(ReconstructConfig, default="quick")
    return parser.run(_reconstruct, arguments)


def _reconstruct(options: argparse.Namespace) -> None:
    run_job(load_config(ReconstructConfig, options.config, _overrides(options)), resume=options.resume)


def _overrides(options: argparse.Namespace) -> list[str]:
    """The options as --set; a picture of one's own has no sample's depth and no ground truth."""
    if options.panorama and options.input:
        raise InputError(f"the panorama is given twice, {options.panorama} and --input {options.input}: leave one out")
    chosen, panorama = [], options.panorama or options.input
    if panorama is not None:
        chosen += [f"input.panorama={toml_value(panorama)}", "input.distance=none", "input.views=none"]
    if options.distance is not None:
        chosen.append(f"input.distance={toml_value(options.distance)}")
    if options.output is not None:
        chosen.append(f"output={toml_value(options.output)}")
    return chosen + options.set


if __name__ == "__main__":
    end_quickly(main())
