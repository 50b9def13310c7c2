"""The mesh of a run's refined scene, for collisions: its rendered distances fused, and their surface cut out."""

import dataclasses

import numpy as np

from experiments.export.scene_panoramas import panoramas, viewpoints
from experiments.run_folder import RunFolder
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.signed_distance import TRUNCATION, Field, blank_field, fuse
from rein3d_jax.io.meshes.surface_mesh import Surface, extract_surface, without_islands
from rein3d_jax.scene import Gaussians
from rein3d_jax.settings import Settings, setting

_JUMP = 3.0  # voxels; a cell spans 1.7, and more where a surface is seen at a slant alone
_MAX_SAMPLES = 64_000_000  # at 24 bytes each
_OUTLYING = 0.005  # of the splats on either side: what lies beyond a window would make the grid huge


@dataclasses.dataclass(frozen=True)
class MeshConfig(Settings):
    """A mesh's fineness."""

    voxel: float = setting(0.05, "side of a voxel", within="[0.001, 1]", unit="metres")
    island: float = setting(0.05, "loose parts below this area are dropped", within="[0, inf)", unit="square metres")


def scene_mesh(run: RunFolder, config: MeshConfig) -> Surface:
    """The surface of the run's scene. Raises InputError where voxels are too small, or without the extra `export`."""
    field, poses = room_field(run.refined, config.voxel), viewpoints(run)
    for frame in panoramas(run, poses):
        field = fuse(field, frame.rgb[0], frame.distance[0], frame.world_from_camera[0])
    return without_islands(surface_of(field), config.island)


def surface_of(field: Field) -> Surface:
    """The surface where the field passes 0."""
    voxel = float(field.voxel)
    return extract_surface(field.signed, field.known, field.rgb, field.low, voxel, jump=_JUMP * voxel)


def room_field(scene: Gaussians, voxel: float) -> Field:
    """A field that knows nothing yet, round all but the outlying splats of `scene`."""
    means = np.asarray(scene.means)[np.asarray(scene.alive)]
    if not len(means):
        raise InputError("the scene is empty: there is nothing to make a mesh of")
    margin = (TRUNCATION + 1) * voxel
    low, high = (np.quantile(means, q, axis=0) for q in (_OUTLYING, 1 - _OUTLYING))
    shape = tuple(int(n) for n in np.ceil((high - low + 2 * margin) / voxel) + 1)
    if np.prod(shape, dtype=float) > _MAX_SAMPLES:
        raise InputError(f"voxel {voxel} asks for {' x '.join(map(str, shape))} samples: raise it")
    return blank_field(low - margin, shape, voxel)
