"""The mesh of a run's refined scene, to bump into: its rendered distances fused, and their surface cut out."""

import dataclasses

import numpy as np

from experiments.export.scene_panoramas import panoramas, viewpoints
from experiments.run_folder import RunFolder
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.signed_distance import TRUNCATION, Field, blank_field, fuse
from rein3d_jax.io.meshes.surface_mesh import Surface, surface, without_islands
from rein3d_jax.scene import Gaussians

JUMP = 3.0  # voxels; a cell spans 1.7, and more where a surface is seen at a slant alone
MOST_SAMPLES = 64_000_000  # at 24 bytes each
OUTLYING = 0.005  # of the splats on either side: what lies beyond a window would make the grid huge


@dataclasses.dataclass(frozen=True)
class MeshConfig:
    """How fine the mesh is."""

    voxel: float = 0.05  # metres
    island: float = 0.05  # square metres; loose parts below it are dropped

    def __post_init__(self):
        if not 0.001 <= self.voxel <= 1 or not self.island >= 0:
            raise InputError("--voxel must lie between 0.001 and 1 metres, and --island be 0 or more")


def scene_mesh(run: RunFolder, config: MeshConfig) -> Surface:
    """The surface of the run's scene. Raises InputError where --voxel is too fine, and without the extra `export`."""
    field, poses = room_field(run.refined, config.voxel), viewpoints(run)
    for frame in panoramas(run, poses):
        field = fuse(field, frame.rgb[0], frame.distance[0], frame.world_from_camera[0])
    return without_islands(surface_of(field), config.island)


def surface_of(field: Field) -> Surface:
    """Where the field passes 0."""
    voxel = float(field.voxel)
    return surface(field.signed, field.known, field.rgb, field.low, voxel, jump=JUMP * voxel)


def room_field(scene: Gaussians, voxel: float) -> Field:
    """A field that knows nothing yet, round all but the outlying splats of `scene`."""
    means = np.asarray(scene.means)[np.asarray(scene.alive)]
    if not len(means):
        raise InputError("the scene is empty: there is nothing to make a mesh of")
    margin = (TRUNCATION + 1) * voxel
    low, high = (np.quantile(means, q, axis=0) for q in (OUTLYING, 1 - OUTLYING))
    shape = tuple(int(n) for n in np.ceil((high - low + 2 * margin) / voxel) + 1)
    if np.prod(shape, dtype=float) > MOST_SAMPLES:
        raise InputError(f"--voxel {voxel} asks for {' x '.join(map(str, shape))} samples: raise it")
    return blank_field(low - margin, shape, voxel)
