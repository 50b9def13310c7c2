"""Panoramas with the place they were taken from, as every data set is handed on; and the poses of such cameras."""

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from rein3d_jax.io.pictures.distance import read_distance
from rein3d_jax.io.pictures.image import read_rgb, resize_panorama
from rein3d_jax.scene import Panorama

# World from camera axes of an equirectangular camera that has not been turned: OpenCV +z is +X, +x is -Y, +y is -Z.
UNTURNED = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
_RIGID = 1e-3  # matrices come from text of a few digits


@dataclass(frozen=True)
class PosedPanorama:
    """A panorama, its distance and its pose in the data set's own world, turned to Z up."""

    name: str
    panorama: Panorama
    world_from_camera: np.ndarray  # (4, 4) float64, OpenCV camera axes


def read_panorama(rgb: Path, distance: Path, height: int | None = None) -> Panorama:
    """The pictures at `rgb` and `distance` as one panorama, brought to `height` rows if that is given. Raises
    InputError for whatever io/image.py and io/distance.py refuse, another size among it."""
    picture = read_rgb(rgb)
    metres, valid = read_distance(distance, picture.shape[:2])
    if height is not None:
        picture, metres, valid = resize_panorama(picture, metres, valid, height)
    return Panorama(*map(jnp.asarray, (picture, metres, valid)))


def pose_of_turn(turn: np.ndarray, position: np.ndarray) -> np.ndarray:
    """world_from_camera (4, 4) of an equirectangular camera turned by `turn` (3, 3), which brings +X to where its
    centre column looks, at `position` (3,)."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.asarray(turn, np.float64) @ UNTURNED, position
    return pose


def rigid_pose(matrix: object) -> np.ndarray:
    """`matrix` as (4, 4) float64. Raises ValueError, with the reason, unless it is a rotation and a translation."""
    pose = np.asarray(matrix, np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError("a pose must be a finite 4x4 matrix")
    turn = pose[:3, :3]
    rotates = np.abs(turn @ turn.T - np.eye(3)).max() < _RIGID and np.linalg.det(turn) > 0
    if not rotates or np.abs(pose[3] - (0, 0, 0, 1)).max() > _RIGID:
        raise ValueError("a pose must be a rotation and a translation, its last row 0 0 0 1")
    return pose


def rays_of_pose(world_from_camera: np.ndarray, height: int) -> np.ndarray:
    """(height, 2 height, 3) unit rays in the world, float64, through the pixel centres of an equirectangular camera:
    geometry/sphere.py's, at the precision that exact distances need."""
    azimuth = ((np.arange(2 * height) + 0.5) / (2 * height) - 0.5) * 2 * np.pi
    latitude = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi)[:, None]
    flat = np.cos(latitude)
    up = np.broadcast_to(np.sin(latitude), (height, 2 * height))
    rays = np.stack([flat * np.cos(azimuth), -flat * np.sin(azimuth), up], axis=-1)
    return rays @ (np.asarray(world_from_camera, np.float64)[:3, :3] @ UNTURNED.T).T
