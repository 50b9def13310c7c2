"""A finished run as files for other tools: engines, simulators, headsets, data sets, a mesh, panoramas, splat formats.

    python -m experiments.export runs/room --to isaac unity nerfstudio posed-frames spz [--output FOLDER]

Writes into the run's `export` folder, or into --output. Folders to hand over, with a README.txt: headset, unity,
unreal, blender, isaac, web. Single formats: OpenUSD, glTF, a mesh, a collider, a navigation mesh, and the scene as
PLY, SuperSplat's compressed PLY, SPZ, SOG or .splat. To train and test on: nerfstudio and COLMAP data sets of the
input's and the restored frames' views, panoramas of the scene (JPEG, and EXR with distance), and what an RGB-D camera
sees along a walk.
"""

import argparse
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path

from experiments.command import CommandParser
from experiments.export.camera_frames import camera_frames
from experiments.export.collider import write_collider
from experiments.export.hand_over import TARGETS, hand_over
from experiments.export.navigation import write_navigation
from experiments.export.posed_pictures import posed_pictures
from experiments.export.scene_files import SCENES, write_gltf, write_mesh, write_scene, write_usd_scene
from experiments.export.scene_mesh import MeshConfig
from experiments.export.scene_panoramas import write_panoramas
from experiments.export.walk import SafeArea, random_walk, read_walk
from experiments.quick_process import begin_quickly, end_quickly
from experiments.run_folder import RunFolder, open_run
from rein3d_jax.io.exports.colmap import write_colmap
from rein3d_jax.io.exports.nerfstudio import write_nerfstudio
from rein3d_jax.io.exports.point_cloud import thinned_points
from rein3d_jax.io.exports.posed_frames import write_posed_frames
from rein3d_jax.io.splats.spz_streams import SPZ_VERSIONS
from rein3d_jax.io.splats.up_axis import UP_AXES
from rein3d_jax.meshes.navigation import AgentConfig

_POINTS = 50_000  # that a data set starts from
_MOST_FRAMES, _LARGEST_SIDE = 100_000, 8192


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    begin_quickly()
    parser = CommandParser("export", __doc__)
    parser.add_argument("run", metavar="RUN_FOLDER", help="what reconstruct wrote, with its stages folder")
    parser.add_argument("--to", nargs="+", required=True, choices=list(_KINDS), metavar="KIND",
                        help=f"what to write, one or more of {', '.join(_KINDS)}")  # fmt: skip
    parser.add_argument("--output", metavar="FOLDER", help="where to write (default: RUN_FOLDER/export)")
    up = "scene's axes: z (the world's, default), y, or y-down, which SuperSplat and PlayCanvas turn upright"
    parser.add_argument("--up", choices=list(UP_AXES), default="z", help=up)
    parser.add_argument("--spz-version", type=int, choices=SPZ_VERSIONS, default=3, help="4 is smaller, 3 read by more")
    parser.add_argument("--voxel", type=float, default=MeshConfig.voxel, help="meshes: metres (default: %(default)s)")
    loose = "mesh: drop loose parts below this area, square metres (default: %(default)s)"
    parser.add_argument("--island", type=float, default=MeshConfig.island, help=loose)
    parser.add_argument("--radius", type=float, default=AgentConfig.radius,
                        help="navigation: of who walks, metres (default: %(default)s)")  # fmt: skip
    parser.add_argument("--height", type=float, default=AgentConfig.height,
                        help="navigation: of who walks, metres (default: %(default)s)")  # fmt: skip
    walk = "posed-frames: a JSON list of places [x, y], or a random walk in the safe area (default)"
    parser.add_argument("--walk", metavar="random|FILE", default="random", help=walk)
    parser.add_argument("--frames", type=_frames, default=60, help="posed-frames: how many (default: %(default)s)")
    parser.add_argument("--size", type=_size, default=(480, 640), metavar="HxW", help="posed-frames (default: 480x640)")
    parser.add_argument("--seed", type=int, default=0, help="posed-frames: of the random walk (default: %(default)s)")
    return parser.run(_export, arguments)


def _export(options: argparse.Namespace) -> None:
    run = open_run(options.run)
    output = Path(options.output) if options.output else run.path / "export"
    for name in options.to:
        print(_KINDS[name](run, output, options=options))


def _frames(text: str) -> int:
    if not 1 <= int(text) <= _MOST_FRAMES:
        raise argparse.ArgumentTypeError(f"must be in [1, {_MOST_FRAMES}], not {text}")
    return int(text)


def _size(text: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d+)x(\d+)", text)
    height, width = map(int, found.groups()) if found else (0, 0)
    if not (1 <= height <= _LARGEST_SIDE and 1 <= width <= _LARGEST_SIDE):
        raise argparse.ArgumentTypeError(f"must be rows x columns, such as 480x640, not {text!r}")
    return height, width


def _nerfstudio(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    count = write_nerfstudio(output / "nerfstudio", posed_pictures(run), thinned_points(run.refined, _POINTS))
    return f"{output / 'nerfstudio'}: {count} pictures"


def _colmap(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    count = write_colmap(output / "colmap", posed_pictures(run), thinned_points(run.refined, _POINTS))
    return f"{output / 'colmap'}: {count} pictures"


def _panoramas(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    count = write_panoramas(run, output / "panoramas")
    return f"{output / 'panoramas'}: {count} panoramas"


def _posed_frames(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    area, given = SafeArea(run), options.walk != "random"
    draw = partial(read_walk, Path(options.walk)) if given else partial(random_walk, area, seed=options.seed)
    places = draw(frames=options.frames)
    count = write_posed_frames(output / "posed-frames", camera_frames(run, places, options.size))
    outside = count - int(area.holds(places).sum())
    return f"{output / 'posed-frames'}: {count} frames, {outside} of them outside the safe area"


_KINDS: dict[str, Callable[[RunFolder, Path, argparse.Namespace], str]] = {
    "nerfstudio": _nerfstudio,
    "colmap": _colmap,
    "mesh": write_mesh,
    "collider": write_collider,
    "navigation": write_navigation,
    "panoramas": _panoramas,
    "posed-frames": _posed_frames,
    "usd": write_usd_scene,
    "gltf": write_gltf,
    **{name: partial(hand_over, target=name) for name in TARGETS},
    **{name: partial(write_scene, suffix=name) for name in SCENES},
}

if __name__ == "__main__":
    end_quickly(main())
