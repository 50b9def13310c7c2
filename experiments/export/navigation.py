"""Where an agent can walk in a run's room: as a mesh, and as polygons."""

import argparse
import json
from pathlib import Path

from experiments.export.collider import run_collider
from experiments.run_folder import RunFolder
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.io.meshes.named_meshes import write_named_meshes
from rein3d_jax.meshes.navigation import AgentConfig, WalkableFloor, walkable_floor


def write_navigation(run: RunFolder, output: Path, options: argparse.Namespace) -> str:
    """Writes navigation.glb and navigation.json for an agent of options.radius and options.height, and says how large
    its floor is."""
    agent = AgentConfig(options.radius, options.height)
    found = walkable_floor(run_collider(run, options.voxel), agent)
    write_named_meshes(output / "navigation.glb", {"navigation": (found.corners, found.faces)})
    write_text(output / "navigation.json", json.dumps(_told(found), indent=1))
    return f"{output / 'navigation.glb'}: {found.area:.1f} square metres to walk on; navigation.json"


def _told(found: WalkableFloor) -> dict:
    polygon = {"outline": _rounded(found.outline), "holes": [_rounded(hole) for hole in found.holes]}
    return {
        "unit": "metres",
        "up": "z",
        "radius": found.agent.radius,
        "height": found.agent.height,
        "floor": found.floor,
        "area": found.area,
        "start": found.start.tolist(),
        "polygons": [polygon],
    }


def _rounded(ring) -> list[list[float]]:
    return ring.round(4).tolist()
