"""Panoramas of rendered rooms (experiments.render_rooms) as training examples, read once and kept in memory."""

from pathlib import Path

import numpy as np

from experiments.render_rooms.floorplan import Floorplan
from experiments.render_rooms.shell import floorplan_distance
from rein3d_jax.depth.network.loss import DepthExample
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.sphere import WORLD_FROM_CAMERA_AXES, rays_of_pose64
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.files.npy import read_arrays
from rein3d_jax.io.pictures.photo import read_rgb

_SEEN_AGAIN = 2  # every so many panoramas of a walk are taken: those between show the same


class RenderedRooms:
    """The panoramas of `height` rows of a folder's rooms, which may still be being rendered."""

    def __init__(self, folder: str | Path, height: int, held_out: int):
        self.folder, self.height, self.held_out_every = Path(folder), height, held_out
        self.trained: list[DepthExample] = []
        self.held_out: list[DepthExample] = []
        self.rooms: set[str] = set()
        self.refresh()
        if not self.trained or not self.held_out:
            raise InputError(
                f"{folder} holds {len(self.rooms)} rendered rooms with panoramas of {height} rows: render more by "
                "`python -m experiments.render_rooms`"
            )

    def refresh(self) -> None:
        """Reads the rooms that have come since."""
        for path in sorted(self.folder.glob("room_*/room.json")):
            if path.parent.name not in self.rooms:
                self.rooms.add(path.parent.name)
                held_out = int(path.parent.name.partition("_")[2]) % self.held_out_every == 0
                (self.held_out if held_out else self.trained).extend(room_examples(path.parent, self.height))


def room_examples(folder: Path, height: int) -> list[DepthExample]:
    """One room's examples (h, 2 h): colours uint8, distances float16."""
    room = read_json(folder / "room.json")
    plan = Floorplan(np.asarray(room["corners"], float), np.asarray(room["ceiling"], float))
    panoramas = [panorama for panorama in room["panoramas"] if panorama["height"] == height]
    walk = [panorama for panorama in panoramas if panorama["name"].startswith("walk")]
    chosen = [panorama for panorama in panoramas if panorama not in walk] + walk[_SEEN_AGAIN::_SEEN_AGAIN]
    return [_example(folder, plan, panorama) for panorama in chosen]


def _example(folder: Path, plan: Floorplan, panorama: dict) -> DepthExample:
    pose, height = np.asarray(panorama["room_from_panorama"], float), panorama["camera_height"]
    axes = np.eye(4)
    axes[:3, :3] = pose[:3, :3] @ WORLD_FROM_CAMERA_AXES
    rays = rays_of_pose64(axes, panorama["height"])
    rgb = read_rgb(folder / f"{panorama['name']}.png")
    (distance,) = read_arrays(folder / f"{panorama['name']}.npz", ["distance"])
    empty = floorplan_distance(plan, pose[:3, 3], rays)
    empty = np.where(np.isfinite(empty), empty, 0)
    return DepthExample(
        np.round(255 * rgb).astype(np.uint8),
        (distance / height).astype(np.float16),
        (empty / height).astype(np.float16),
    )
