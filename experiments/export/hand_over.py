"""One folder to hand over: what a headset, an engine, a simulator or a web page wants of a run, and how to open it."""

import argparse
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

from experiments.export.collider import run_collider
from experiments.export.scene_files import write_gltf, write_mesh, write_scene, write_usd_scene
from experiments.export.walk import floor_depth
from experiments.run_folder import RunFolder
from rein3d_jax.io.files.atomic import write_bytes, write_text
from rein3d_jax.io.files.input_file import require_file
from rein3d_jax.io.meshes.named_meshes import write_named_meshes
from rein3d_jax.io.splats.gaussian_file import write_splats
from rein3d_jax.lift.detail_order import lighter_scene

TARGETS = ("headset", "unity", "unreal", "blender", "isaac", "web")
HEADSET_BUDGET = 500_000  # splats that a Quest 3 shows fast enough for both eyes
_Part = Callable[[RunFolder, Path, argparse.Namespace], object]


def hand_over(run: RunFolder, output: Path, target: str, options: argparse.Namespace) -> str:
    """Writes the folder `target`, one of TARGETS, README.txt last. Raises InputError where the target wants the run's
    viewer.html and there is none, and as its formats do."""
    folder = output / target
    for write in _PARTS[target]:
        write(run, folder, options)
    note = files(__package__).joinpath("hand_over_notes", f"{target}.txt").read_text("utf-8")
    told = {"floor": f"{floor_depth(run):.2f}", "count": f"{int(run.refined.alive.sum()):,}"}
    write_text(folder / "README.txt", note.format(**told))
    return f"{folder}: {', '.join(sorted(path.name for path in folder.iterdir()))}"


def _scene(suffix: str, up: str = "z") -> _Part:
    return lambda run, folder, options: write_scene(run, folder, suffix, argparse.Namespace(up=up, spz_version=3))


def _viewer(run: RunFolder, folder: Path, options: argparse.Namespace) -> None:
    require_file(run.path / "viewer.html")
    write_bytes(folder / "viewer.html", (run.path / "viewer.html").read_bytes())


def _collider(run: RunFolder, folder: Path, options: argparse.Namespace) -> None:
    found = run_collider(run, options.voxel)
    write_named_meshes(folder / "collider.glb", {"collider": (found.vertices, found.faces)})


def _light_scene(run: RunFolder, folder: Path, options: argparse.Namespace) -> None:
    scene, antialias = lighter_scene(run.refined, HEADSET_BUDGET), run.config.rasterize.antialias
    write_splats(folder / "scene.sog", scene, antialias=antialias, up="y-down")


_PARTS: dict[str, tuple[_Part, ...]] = {
    "headset": (_viewer, _light_scene),
    "unity": (_scene("ply", "y"), _collider),
    "unreal": (_scene("ply"), _collider),
    "blender": (_scene("ply"), write_mesh),
    "isaac": (write_usd_scene,),
    "web": (_viewer, _scene("sog", "y-down"), write_gltf),
}
