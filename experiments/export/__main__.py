"""A finished run as files for other tools: data sets, a mesh, panoramas, splat formats.

    python -m experiments.export runs/room --to nerfstudio colmap mesh panoramas spz [--output FOLDER]

Writes into the run's `export` folder, or into --output: a nerfstudio and a COLMAP data set of the input's and the
restored frames' views, a collision mesh (mesh.glb), panoramas of the scene (JPEG, and EXR with distance), and the scene
as PLY, SuperSplat's compressed PLY, SPZ or .splat.
"""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from experiments.command import CommandParser
from experiments.export.posed_pictures import posed_pictures
from experiments.export.scene_mesh import MeshConfig, scene_mesh
from experiments.export.scene_panoramas import write_panoramas
from experiments.run_folder import RunFolder, open_run
from rein3d_jax.io.exports.colmap import write_colmap
from rein3d_jax.io.exports.nerfstudio import write_nerfstudio
from rein3d_jax.io.exports.point_cloud import thinned_points
from rein3d_jax.io.meshes.surface_mesh import write_glb
from rein3d_jax.io.splats.gaussian_file import write_splats

_POINTS = 50_000  # that a data set starts from
SCENES = ("ply", "compressed.ply", "spz", "splat")


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where the input is at fault."""
    parser = CommandParser("export", __doc__)
    parser.add_argument("run", metavar="RUN_FOLDER", help="what reconstruct wrote, with its stages folder")
    kinds = [*_KINDS, *SCENES]
    parser.add_argument("--to", nargs="+", required=True, choices=kinds, metavar="KIND",
                        help=f"what to write, one or more of {', '.join(kinds)}")  # fmt: skip
    parser.add_argument("--output", metavar="FOLDER", help="where to write (default: RUN_FOLDER/export)")
    parser.add_argument("--voxel", type=float, default=MeshConfig.voxel, help="mesh: metres (default: %(default)s)")
    loose = "mesh: drop loose parts below this area, square metres (default: %(default)s)"
    parser.add_argument("--island", type=float, default=MeshConfig.island, help=loose)
    return parser.run(_export, arguments)


def _export(options: argparse.Namespace) -> None:
    run = open_run(options.run)
    output = Path(options.output) if options.output else run.path / "export"
    for name in options.to:
        print(_KINDS[name](run, output, options) if name in _KINDS else _scene(run, output, name))


def _nerfstudio(run: RunFolder, output: Path, options) -> str:
    count = write_nerfstudio(output / "nerfstudio", posed_pictures(run), thinned_points(run.refined, _POINTS))
    return f"{output / 'nerfstudio'}: {count} pictures"


def _colmap(run: RunFolder, output: Path, options) -> str:
    count = write_colmap(output / "colmap", posed_pictures(run), thinned_points(run.refined, _POINTS))
    return f"{output / 'colmap'}: {count} pictures"


def _mesh(run: RunFolder, output: Path, options) -> str:
    found = scene_mesh(run, MeshConfig(options.voxel, options.island))
    write_glb(output / "mesh.glb", found)
    return f"{output / 'mesh.glb'}: {len(found.faces):,} triangles"


def _panoramas(run: RunFolder, output: Path, options) -> str:
    count = write_panoramas(run, output / "panoramas")
    return f"{output / 'panoramas'}: {count} panoramas"


def _scene(run: RunFolder, output: Path, suffix: str) -> str:
    path = output / f"scene.{suffix}"
    write_splats(path, run.refined, antialias=run.config.rasterize.antialias)
    return f"{path}: {path.stat().st_size / 1e6:.1f} MB"


_KINDS: dict[str, Callable[..., str]] = {
    "nerfstudio": _nerfstudio,
    "colmap": _colmap,
    "mesh": _mesh,
    "panoramas": _panoramas,
}

if __name__ == "__main__":
    sys.exit(main())
