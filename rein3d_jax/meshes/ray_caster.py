"""First hits of rays on a soup of triangles: embree finds the triangle in float32, its plane gives the distance in
float64."""

from dataclasses import dataclass

import numpy as np

from rein3d_jax.errors import InputError
from rein3d_jax.meshes.triangles import plane_normals


@dataclass(frozen=True)
class Hits:
    """First hits of n rays."""

    triangle: np.ndarray  # (n,) int, -1 = nothing
    distance: np.ndarray  # (n,) float64 metres, 0 where nothing


class RayCaster:
    """Triangles (n, 3, 3) with an area, and embree's tree over them. Raises InputError without embreex."""

    def __init__(self, corners: np.ndarray):
        try:
            from embreex.mesh_construction import TriangleMesh
            from embreex.rtcore_scene import EmbreeScene
        except ImportError as error:
            raise InputError("tracing meshes needs embreex: pip install 'rein3d-jax[data]'") from error
        self.normal, self.area = plane_normals(corners)  # (n, 3) unit, (n,)
        self.anchor = corners[:, 0]  # a point on each plane
        self.bounds = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])  # (2, 3)
        self._centre = self.bounds.mean(axis=0)  # so that float32 keeps its digits far from the origin
        self._scene = EmbreeScene()
        TriangleMesh(self._scene, (corners - self._centre).astype(np.float32))

    def cast(self, origins: np.ndarray, rays: np.ndarray) -> Hits:
        """First hits of unit rays (n, 3) from origins (n, 3) or (3,)."""
        starts = np.broadcast_to(origins - self._centre, rays.shape)
        triangle = self._scene.run(np.array(starts, np.float32), np.array(rays, np.float32)).astype(np.int64)
        hit = np.flatnonzero(triangle >= 0)
        plane = triangle[hit]
        to_plane = self.anchor[plane] - np.broadcast_to(origins, rays.shape)[hit]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (self.normal[plane] * to_plane).sum(1) / (self.normal[plane] * rays[hit]).sum(1)
        found = np.isfinite(distance) & (distance > 0)  # a ray in the plane itself has no crossing
        triangle[hit[~found]] = -1
        far = np.zeros(len(rays))
        far[hit[found]] = distance[found]
        return Hits(triangle, far)
