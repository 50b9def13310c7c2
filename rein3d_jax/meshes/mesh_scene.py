"""Mesh scenes: textured triangles that give a panorama and its distance from any pose.

Light is not simulated: a surface shows its base colour times AMBIENT + DIRECTED (1 + n . l) / 2, in sRGB, with one
fixed l and n the flat normal of the side that is seen. Walls, floor and ceiling differ, nothing casts a shadow, and a
surface has one colour from everywhere, which pairs of clean and degraded frames need.
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from rein3d_jax.geometry.sphere import rays_of_pose64
from rein3d_jax.meshes.ray_caster import Hits, RayCaster
from rein3d_jax.meshes.texture import sample_texture
from rein3d_jax.meshes.triangles import Triangles

AMBIENT, DIRECTED = 0.6, 0.4
_LIGHT = np.array([0.36, 0.48, 0.8])  # unit: no two walls of a room alike, the floor brighter than the ceiling
SKY = 0.9  # grey that is seen where nothing is hit
_STRIP = 1 << 18  # rays at once: what bounds memory
_GRAZING = 0.05  # cosine below which a footprint grows no more


@dataclass(frozen=True)
class MeshScene:
    """A traceable scene whose world is Z up, in metres, with `origin` (in the file's frame) at its origin."""

    name: str  # the file it was read from
    soup: Triangles
    caster: RayCaster
    origin: np.ndarray  # (3,) float64
    missing: tuple[str, ...] = ()  # models and textures that the scene names and its data set does not have

    def at(self, origin: np.ndarray) -> "MeshScene":
        """The same scene with the world's origin at `origin`, a point of the world as it is now."""
        return replace(self, origin=self.origin + np.asarray(origin, np.float64))

    @property
    def bounds(self) -> np.ndarray:
        """(2, 3) metres: the lowest and the highest corner of the box around everything."""
        return self.caster.bounds - self.origin

    def cast(self, origins: np.ndarray, rays: np.ndarray) -> Hits:
        """First hits of unit rays (n, 3) from origins (n, 3) or (3,)."""
        return self.caster.cast(np.asarray(origins, np.float64) + self.origin, np.asarray(rays, np.float64))

    def trace(self, world_from_camera: np.ndarray, height: int, *, samples: int = 3) -> tuple[np.ndarray, np.ndarray]:
        """The panorama at `world_from_camera` (4, 4), OpenCV camera axes: rgb (height, 2 height, 3) sRGB in [0, 1],
        the mean of samples^2 rays a pixel, and distance (height, 2 height) along the ray of the pixel's centre, 0
        where nothing is hit; float32. `samples` is odd, so that one of them is the centre."""
        assert samples % 2 == 1 and world_from_camera.shape == (4, 4), (samples, world_from_camera.shape)
        rows = height * samples
        rays = rays_of_pose64(world_from_camera, rows).reshape(-1, 3)
        eye = np.asarray(world_from_camera, np.float64)[:3, 3]
        colour, distance = np.empty((len(rays), 3), np.float32), np.empty(len(rays), np.float32)
        for start in range(0, len(rays), _STRIP):
            strip = slice(start, start + _STRIP)
            hits = self.cast(eye, rays[strip])
            colour[strip], distance[strip] = self._colour(eye, rays[strip], hits, np.pi / rows), hits.distance
        rgb = colour.reshape(height, samples, 2 * height, samples, 3).mean(axis=(1, 3))
        middle = slice(samples // 2, None, samples)
        return rgb.clip(0, 1), distance.reshape(rows, 2 * rows)[middle, middle]

    def _colour(self, eye: np.ndarray, rays: np.ndarray, hits: Hits, pixel: float) -> np.ndarray:
        """(n, 3); `pixel` is the angle between neighbouring rays."""
        colour = np.full((len(rays), 3), SKY)
        hit = np.flatnonzero(hits.triangle >= 0)
        face, toward = hits.triangle[hit], rays[hit]
        point = eye + self.origin + toward * hits.distance[hit, None]
        cosine = (self.caster.normal[face] * toward).sum(1)
        side = pixel * hits.distance[hit] / np.sqrt(np.maximum(np.abs(cosine), _GRAZING))  # of the footprint's square
        lit = (1 - np.sign(cosine) * (self.caster.normal[face] @ _LIGHT)) / 2
        base = self.soup.colour[face] * self._texture(face, point, side, self.caster.area[face])
        colour[hit] = base * (AMBIENT + DIRECTED * lit[:, None])
        return colour

    def _texture(self, face: np.ndarray, point: np.ndarray, side: np.ndarray, area: np.ndarray) -> np.ndarray:
        colour = np.ones((len(face), 3))
        for index in np.unique(self.soup.textured[face]):
            if index >= 0:
                here = np.flatnonzero(self.soup.textured[face] == index)
                picture, corners = self.soup.textures[index], self.soup.uv[face[here]].astype(np.float64)
                texels = _area_2d(corners) * picture.texels
                with np.errstate(divide="ignore"):  # a face of one texel has level -inf: the full picture
                    level = np.log2(side[here] * np.sqrt(texels / area[here]))
                places = (self._barycentric(face[here], point[here])[..., None] * corners).sum(1)
                colour[here] = sample_texture(picture, places, level)
        return colour

    def _barycentric(self, face: np.ndarray, point: np.ndarray) -> np.ndarray:
        """(n, 3) weights of the corners of `face` at `point` (Ericson 2004, 3.4)."""
        a, b, c = np.moveaxis(self.soup.corners[face], 1, 0)
        ab, ac, ap = b - a, c - a, point - a
        d00, d01, d11 = (ab * ab).sum(1), (ab * ac).sum(1), (ac * ac).sum(1)
        d20, d21 = (ap * ab).sum(1), (ap * ac).sum(1)
        scale = d00 * d11 - d01 * d01
        v, w = (d11 * d20 - d01 * d21) / scale, (d00 * d21 - d01 * d20) / scale
        return np.stack([1 - v - w, v, w], axis=1)


def mesh_scene(path: str | Path, soup: Triangles, missing: tuple[str, ...] = ()) -> MeshScene:
    """Scene of the soup that was read from `path`. Raises InputError without embreex."""
    return MeshScene(str(path), soup, RayCaster(soup.corners), np.zeros(3), missing)


def _area_2d(corners: np.ndarray) -> np.ndarray:
    (du, dv), (eu, ev) = (np.moveaxis(corners[:, i] - corners[:, 0], -1, 0) for i in (1, 2))
    return np.abs(du * ev - dv * eu) / 2
