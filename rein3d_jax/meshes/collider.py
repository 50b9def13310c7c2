"""A room's collider: the border of its free space as one closed mesh, fronts facing the room, cut straight at the
room's shell, so that floor, walls and ceiling are planes, windows are closed, and nothing lies beyond."""

from collections.abc import Iterable
from dataclasses import dataclass
from types import ModuleType
from typing import Any

import jax
import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import RoomShell, world_from_shell
from rein3d_jax.meshes.free_space import FLATTENED, FreeVotes, blank_votes, shell_corners, vote
from rein3d_jax.meshes.solid import box_solid, closed_solid, mesh_of_solid

MAX_COLLIDER_TRIANGLES = 20_000
_SPECK = 0.15  # metres: what floats in the room and is smaller than this cubed is an error of some splats
_MOVED = 0.2  # voxels that a surface may move for fewer triangles, at first;
_MORE = 1.5  # then so many times that, until they are few enough
_WELD = 1e-5  # metres: edges shorter than that are rounding's


@dataclass(frozen=True)
class Collider:
    """A closed mesh in the world, fronts facing the free space inside it."""

    vertices: np.ndarray  # (v, 3) float64 metres
    faces: np.ndarray  # (f, 3) int
    shell: RoomShell  # the box that it lies in

    @property
    def floor(self) -> float:
        """The floor's z, metres."""
        return -float(self.shell.floor)


def room_collider(
    shell: RoomShell, panoramas: Iterable[tuple[jax.Array, jax.Array]], *, voxel: float = 0.05
) -> Collider:
    """The collider of the room in `shell` by what panoramas saw: distances (h, 2 h), metres along the ray, 0 where
    unknown, and poses world_from_camera (4, 4), the first one's place in free space. Never more than
    MAX_COLLIDER_TRIANGLES. Raises InputError where voxels are too small or too large, without the extra `export`, or
    where the first panorama's place is not free."""
    votes, start = blank_votes(shell, voxel), None
    for distance, pose in panoramas:
        votes = vote(votes, distance, pose)
        start = np.asarray(pose)[:3, 3] if start is None else start
    rotation = np.asarray(world_from_shell(shell), np.float64)
    solid = _straightened(_one_room(votes, start @ rotation), votes)
    vertices, faces = mesh_of_solid(solid)
    return Collider(vertices @ rotation.T, faces[:, ::-1], shell)


def _one_room(votes: FreeVotes, start: np.ndarray) -> np.ndarray:
    """Metres (x, y, z), positive in the free space that hangs together with the place `start` (3,) of the shell's
    axes; specks that float in it are free too. Never 0."""
    label = _measure().label
    signed = np.asarray(votes.signed, np.float64)
    index = np.round((start - np.asarray(votes.low)) / float(votes.voxel)).astype(int)
    parts = label(signed > 0, connectivity=1)
    here = parts[tuple(np.clip(index, 0, np.array(parts.shape) - 1))]
    if not here:
        raise InputError("the place that the scene was seen from is not free: a collider needs a place to start from")
    solids = label(parts != here, connectivity=1)
    specks = np.bincount(solids.ravel()) < (_SPECK / float(votes.voxel)) ** 3
    specks[0] = True  # the free space itself
    size = np.maximum(np.abs(signed), 1e-3 * float(votes.voxel))
    return np.where(specks[solids], size, -size)


def _straightened(signed: np.ndarray, votes: FreeVotes) -> Any:
    """The free space as a Manifold in the shell's axes. The outermost samples go on to the shell's faces."""
    voxel, beyond = float(votes.voxel), int(FLATTENED / float(votes.voxel)) + 2
    samples = np.pad(np.pad(signed, beyond, mode="edge"), 1, constant_values=-voxel)
    vertices, faces, _, _ = _measure().marching_cubes(samples, 0.0, gradient_direction="ascent")
    places = np.asarray(votes.low, np.float64) + (vertices.astype(np.float64) - beyond - 1) * voxel
    whole, box, moved = closed_solid(places, faces), box_solid(*shell_corners(votes.shell)), _MOVED * voxel
    while (found := (whole.simplify(moved) ^ box).simplify(_WELD)).num_tri() > MAX_COLLIDER_TRIANGLES:
        moved *= _MORE
    return found


def _measure() -> ModuleType:
    try:
        from skimage import measure
    except ImportError as error:
        raise InputError("a collider needs scikit-image: pip install 'rein3d-jax[export]'") from error
    return measure
