"""A nerfstudio data set: transforms.json, images/, masks/ (black pixels are left out of training), points.ply.

Poses are camera to world with OpenGL's camera axes (+x right, +y up, +z backward), in our world: metres, +Z up.
Source: docs.nerf.studio, "Data conventions".
"""

import json
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from rein3d_jax.io.exports.point_cloud import Points, write_points
from rein3d_jax.io.exports.posed_picture import IMAGES, MASKS, PosedPicture, write_posed_picture
from rein3d_jax.io.files.atomic import write_text

OPENCV_FROM_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


def write_nerfstudio(folder: Path, pictures: Iterable[PosedPicture], points: Points) -> int:
    """Writes the data set, transforms.json last: where it is, all is. Returns how many pictures there were. Raises
    InputError where a file cannot be written."""
    frames = [_frame(folder, picture) for picture in pictures]
    write_points(folder / "points.ply", points)
    scene = {"camera_model": "OPENCV", "ply_file_path": "points.ply", "frames": frames}
    write_text(folder / "transforms.json", json.dumps(scene, indent=1) + "\n")
    return len(frames)


def _frame(folder: Path, picture: PosedPicture) -> dict:
    name, camera = write_posed_picture(folder, picture, ".png"), picture.camera
    (fl_x, fl_y), (cx, cy) = (np.asarray(pair, np.float64).tolist() for pair in (camera.focal, camera.centre))
    return {
        "file_path": f"{IMAGES}/{name}", "mask_path": f"{MASKS}/{name}",
        "w": camera.width, "h": camera.height, "fl_x": fl_x, "fl_y": fl_y, "cx": cx, "cy": cy,
        "transform_matrix": (picture.pose @ OPENCV_FROM_OPENGL).tolist(),
    }  # fmt: skip
