"""Truncated signed distance fields fused from panoramas (Curless and Levoy 1996): positive in free space, negative
behind a surface, unknown where no panorama saw."""

import jax
import jax.numpy as jnp
from flax import struct

from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.sphere import pixels_from_rays, world_from_panorama

TRUNCATION = 4.0  # voxels
_SAME_SURFACE = 0.02  # relative; the means of d and of 1/d of four pixels agree on one surface only


@struct.dataclass
class Field:
    """A grid of (x, y, z) samples. `sums` hold what was fused so far: of truncated distances in voxels, of their
    weights; of colours near a surface, of theirs."""

    low: jax.Array  # (3,) metres, the world's place of the first sample
    voxel: jax.Array  # () metres between samples
    sums: jax.Array  # (x, y, z, 6)

    @property
    def known(self) -> jax.Array:
        """The samples (x, y, z) bool that some panorama saw."""
        return self.sums[..., 1] > 0

    @property
    def signed(self) -> jax.Array:
        """Signed distances (x, y, z) metres, at most TRUNCATION voxels; free where unknown."""
        mean = self.sums[..., 0] / jnp.maximum(self.sums[..., 1], 1.0)
        return jnp.where(self.known, mean, TRUNCATION) * self.voxel

    @property
    def rgb(self) -> jax.Array:
        """Colours (x, y, z, 3) sRGB, black away from surfaces."""
        return self.sums[..., 2:5] / jnp.maximum(self.sums[..., 5:], 1.0)


def blank_field(low: jax.Array, shape: tuple[int, int, int], voxel: float) -> Field:
    """A field of `shape` samples from `low` (3,) on, `voxel` metres apart, that knows nothing."""
    return Field(jnp.asarray(low, jnp.float32), jnp.float32(voxel), jnp.zeros((*shape, 6)))


def _fuse(field: Field, rgb: jax.Array, distance: jax.Array, world_from_camera: jax.Array) -> Field:
    """The field with one more panorama: (h, w, 3) sRGB, (h, w) metres along the ray, 0 where unknown; its pose (4, 4)
    is of OpenCV axes."""
    inverse = jnp.where(distance > 0, 1 / jnp.where(distance > 0, distance, 1.0), 0.0)
    image = jnp.concatenate([jnp.stack([distance, inverse], axis=-1), rgb], axis=-1)
    rotation = world_from_panorama(world_from_camera)
    _, y, z = (field.low[axis] + jnp.arange(size) * field.voxel for axis, size in enumerate(field.sums.shape[:3]))

    def slab(carried):  # one x at a time: a room's whole grid would take gigabytes
        index, sums = carried
        x = jnp.broadcast_to(field.low[0] + index * field.voxel, (y.size, z.size))
        offset = jnp.stack([x, *jnp.meshgrid(y, z, indexing="ij")], axis=-1) - world_from_camera[:3, 3]
        rays = jnp.matmul(offset, rotation, precision="highest")
        shown = sample_sphere(image, *pixels_from_rays(rays, *distance.shape))
        signed = (shown[..., 0] - jnp.linalg.norm(offset, axis=-1)) / field.voxel
        sure = (jnp.abs(shown[..., 0] * shown[..., 1] - 1) < _SAME_SURFACE) & (signed > -TRUNCATION)
        near = (sure & (signed < TRUNCATION)).astype(jnp.float32)[..., None]
        weight = sure.astype(jnp.float32)[..., None]
        value = jnp.clip(signed, -TRUNCATION, TRUNCATION)[..., None]
        return sums + jnp.concatenate([weight * value, weight, near * shown[..., 2:], near], axis=-1)

    return field.replace(sums=jax.lax.map(slab, (jnp.arange(field.sums.shape[0]), field.sums)))


fuse = jax.jit(_fuse, donate_argnums=0)
