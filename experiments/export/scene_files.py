"""A run's refined scene in the formats of viewers, engines and simulators."""

import argparse
from pathlib import Path

import numpy as np

from experiments.export.collider import run_collider
from experiments.export.scene_mesh import MeshConfig, scene_mesh
from experiments.export.walk import SafeArea, floor_depth
from experiments.run_folder import RunFolder
from rein3d_jax.io.exports.usd import UsdScene, write_usd
from rein3d_jax.io.meshes.surface_mesh import write_glb
from rein3d_jax.io.splats.gaussian_file import write_splats
from rein3d_jax.io.splats.gltf_splats import write_gltf_splats
from rein3d_jax.io.splats.spz import write_spz
from rein3d_jax.io.splats.up_axis import with_up
from rein3d_jax.lift.detail_order import in_detail_order

SCENES = ("ply", "compressed.ply", "spz", "sog", "splat")
_PLAIN = ("ply", "splat")  # the others pack neighbours together: an SPZ in detail order is 45 % larger


def write_scene(run: RunFolder, output: Path, suffix: str, options: argparse.Namespace) -> str:
    """scene.SUFFIX, one of SCENES, in the axes `options.up`; in detail order where that costs no bytes."""
    path, antialias = output / f"scene.{suffix}", run.config.rasterize.antialias
    scene = in_detail_order(run.refined) if suffix in _PLAIN else run.refined
    if suffix == "spz" and options.spz_version != 3:
        write_spz(path, with_up(scene, options.up), antialias=antialias, version=options.spz_version)
    else:
        write_splats(path, scene, antialias=antialias, up=options.up)
    return size_told(path)


def write_mesh(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    """mesh.glb: every surface, with its colours."""
    found = scene_mesh(run, MeshConfig(options.voxel, options.island))
    write_glb(output / "mesh.glb", found)
    return f"{output / 'mesh.glb'}: {len(found.faces):,} triangles"


def write_gltf(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    """scene.glb, the splats, and mesh.glb, for what knows no splats."""
    write_gltf_splats(output / "scene.glb", in_detail_order(run.refined))
    return f"{size_told(output / 'scene.glb')}\n{write_mesh(run, output, options)}"


def write_usd_scene(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    """scene.usdc and scene.usdz."""
    outline, collider = SafeArea(run).outline(), run_collider(run, options.voxel)
    corners = np.insert(outline, 2, -floor_depth(run), axis=1)
    antialias = run.config.rasterize.antialias
    scene = UsdScene(run.refined, (collider.vertices, collider.faces), corners, antialias)
    return "\n".join(map(size_told, write_usd(output, scene)))


def size_told(path: Path) -> str:
    """A file's path and size, as a user reads it."""
    return f"{path}: {path.stat().st_size / 1e6:.1f} MB"
