"""Panoramas with the place they were taken from, as every data set is handed on; and the poses of such cameras."""

from dataclasses import dataclass

import numpy as np

from rein3d_jax.geometry.sphere import WORLD_FROM_CAMERA_AXES
from rein3d_jax.scene import Panorama

_RIGID = 1e-3  # matrices come from text of a few digits


@dataclass(frozen=True)
class PosedPanorama:
    """A panorama, its distance and its pose in the data set's own world, rotated to Z up."""

    name: str
    panorama: Panorama
    world_from_camera: np.ndarray  # (4, 4) float64, OpenCV camera axes


def panorama_pose(rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """world_from_camera (4, 4) of an equirectangular camera at `position` (3,), rotated by `rotation` (3, 3), which
    brings +X to the direction of its centre column."""
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.asarray(rotation, np.float64) @ WORLD_FROM_CAMERA_AXES, position
    return pose


def rigid_pose(matrix: object) -> np.ndarray:
    """The pose `matrix` as (4, 4) float64. Raises ValueError, with the reason, unless it rotates and moves."""
    pose = np.asarray(matrix, np.float64)
    if pose.shape != (4, 4) or not np.isfinite(pose).all():
        raise ValueError("a pose must be a finite 4x4 matrix")
    rotation = pose[:3, :3]
    rotates = np.abs(rotation @ rotation.T - np.eye(3)).max() < _RIGID and np.linalg.det(rotation) > 0
    if not rotates or np.abs(pose[3] - (0, 0, 0, 1)).max() > _RIGID:
        raise ValueError("a pose must be a rotation and a translation, its last row 0 0 0 1")
    return pose
