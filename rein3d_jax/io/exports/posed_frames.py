"""What an RGB-D camera sees along a walk, as files: rgb/, depth/, distance/ and normals/, transforms.json, frames.json.

    rgb/NAME.png        8-bit sRGB
    depth/NAME.png      16-bit millimetres along the camera's axis, as depth cameras have it; 0: unknown, or over 65.5 m
    distance/NAME.exr   float32 metres along each pixel's ray; 0: unknown
    normals/NAME.exr    float32 x y z in the world, unit, towards the camera; 0: unknown
    transforms.json     nerfstudio's: OpenGL's camera axes (+x right, +y up, +z back); depth_file_path is depth/
    frames.json         the same in plain words: OpenCV's camera axes (+x right, +y down, +z forward), quaternions wxyz

The world: metres, +Z up. Sources: docs.nerf.studio, "Data conventions"; ROS REP 118 for depth in millimetres.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.io.exports.nerfstudio import OPENCV_FROM_OPENGL
from rein3d_jax.io.files.atomic import write_bytes, write_text
from rein3d_jax.io.pictures.distance import write_distance_exr
from rein3d_jax.io.pictures.exr import write_exr
from rein3d_jax.io.pictures.image import write_rgb
from rein3d_jax.scene import Camera

_FARTHEST = 65.535  # metres, of 16 bits of millimetres
_WORDS = "metres, Z up, right-handed; camera x right, y down, z forward; distance along the ray, depth along z"


@dataclass(frozen=True)
class PosedFrame:
    """What one camera sees."""

    rgb: np.ndarray  # (h, w, 3) sRGB
    distance: np.ndarray  # (h, w) metres along the ray, 0 where unknown
    normals: np.ndarray  # (h, w, 3) unit, world, towards the camera; 0 where unknown
    camera: Camera  # pinhole


def write_posed_frames(folder: Path, frames: Iterable[PosedFrame]) -> int:
    """Writes the files, the two JSON last: where they are, all is. Returns how many frames there were. Raises
    InputError where a file cannot be written."""
    cameras = [_write(folder, f"{index:05d}", frame) for index, frame in enumerate(frames)]
    nerfstudio = {"camera_model": "OPENCV", "frames": list(map(_opengl, cameras))}
    write_text(folder / "transforms.json", json.dumps(nerfstudio, indent=1) + "\n")
    write_text(folder / "frames.json", json.dumps({"conventions": _WORDS, "frames": cameras}, indent=1) + "\n")
    return len(cameras)


def _write(folder: Path, name: str, frame: PosedFrame) -> dict:
    camera, files = frame.camera, {kind: f"{kind}/{name}.png" for kind in ("rgb", "depth")}
    files |= {kind: f"{kind}/{name}.exr" for kind in ("distance", "normals")}
    write_rgb(folder / files["rgb"], frame.rgb)
    write_bytes(folder / files["depth"], _depth_png(frame))
    write_distance_exr(folder / files["distance"], frame.distance)
    write_exr(folder / files["normals"], dict(zip("XYZ", np.moveaxis(frame.normals, -1, 0), strict=True)))
    pose = np.asarray(camera.world_from_camera, np.float64)
    focal, centre = (np.asarray(pair, np.float64).tolist() for pair in (camera.focal, camera.centre))
    return {
        **files, "width": camera.width, "height": camera.height, "focal": focal, "centre": centre,
        "position": pose[:3, 3].tolist(), "quaternion": np.asarray(quats_from_matrix(pose[:3, :3])).tolist(),
        "world_from_camera": pose.tolist(),
    }  # fmt: skip


def _opengl(camera: dict) -> dict:
    (fl_x, fl_y), (cx, cy) = camera["focal"], camera["centre"]
    return {
        "file_path": camera["rgb"], "depth_file_path": camera["depth"],
        "w": camera["width"], "h": camera["height"], "fl_x": fl_x, "fl_y": fl_y, "cx": cx, "cy": cy,
        "transform_matrix": (np.array(camera["world_from_camera"]) @ OPENCV_FROM_OPENGL).tolist(),
    }  # fmt: skip


def _depth_png(frame: PosedFrame) -> bytes:
    camera = frame.camera
    rays = np.asarray(pinhole_rays(camera.height, camera.width, camera.focal, camera.centre))
    depth = frame.distance / np.linalg.norm(rays, axis=-1)
    millimetres = np.where(depth <= _FARTHEST, np.round(1000 * depth), 0).astype(np.uint16)
    return cv2.imencode(".png", millimetres)[1].tobytes()
