"""A run's collider: one closed mesh of its room, and the same as convex parts."""

import argparse
import functools
from pathlib import Path

from experiments.export.scene_panoramas import panoramas, viewpoints
from experiments.run_folder import RunFolder
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.io.meshes.named_meshes import write_named_meshes
from rein3d_jax.meshes.collider import Collider, room_collider
from rein3d_jax.meshes.convex_parts import convex_parts


@functools.cache
def run_collider(run: RunFolder, voxel: float) -> Collider:
    """The collider of what the refined scene shows from the origin and from the middle and end of each path, inside
    the shell of what the input saw; made once however many exports want it. Raises InputError."""
    shell, _ = shell_from_distance(run.panorama)
    poses = viewpoints(run)
    seen = ((frame.distance[0], frame.world_from_camera[0]) for frame in panoramas(run, poses))
    return room_collider(shell, seen, voxel=voxel)


def write_collider(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    """Writes collider.glb and collider_parts.glb, and says what they hold."""
    found = run_collider(run, options.voxel)
    parts = convex_parts(found)
    write_named_meshes(output / "collider.glb", {"collider": (found.vertices, found.faces)})
    write_named_meshes(output / "collider_parts.glb", parts)
    return f"{output / 'collider.glb'}: {len(found.faces):,} triangles; collider_parts.glb: {len(parts)} convex parts"
