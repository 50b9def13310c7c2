"""Scenes in other axes than the world's: means, orientations and spherical harmonics rotated together.

The world has +Z up. `y` has Y up: X stays, -Z is where +Y was, as glTF wants and mesh.glb is. `y-down` is `y` half a
turn about Z, as the 3DGS paper's own scenes lie: SuperSplat, PlayCanvas and splat-transform turn PLY and .splat by that
half turn, the first and the last SPZ too, and so show it upright and in mesh.glb's place.
"""

import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.rotations import matrix_from_quats, quats_from_matrix
from rein3d_jax.geometry.spherical_harmonics import basis
from rein3d_jax.io.meshes.surface_mesh import Y_UP_FROM_Z_UP
from rein3d_jax.scene import Gaussians

# Axes by name: their rotation (3, 3) from the world's, and what a file says of them.
UP_AXES = {
    "z": (np.eye(3), "Z up"),
    "y": (Y_UP_FROM_Z_UP, "Y up"),
    "y-down": (np.diag([-1.0, -1.0, 1.0]) @ Y_UP_FROM_Z_UP, "Y down"),
}
_RAYS = 64  # four times as many as there are coefficients


def with_up(gaussians: Gaussians, up: str) -> Gaussians:
    """The scene in the axes `up`, one of UP_AXES. Exact in means; in the others up to float32's rounding."""
    return gaussians if up == "z" else rotated_scene(gaussians, UP_AXES[up][0])


def rotated_scene(gaussians: Gaussians, rotation: np.ndarray) -> Gaussians:
    """The scene rotated by `rotation` (3, 3) about the origin: from everywhere it looks as before from there."""
    axes = np.asarray(matrix_from_quats(gaussians.quats), np.float64)
    mixing = sh_rotation(rotation, gaussians.sh.shape[1])
    return gaussians.replace(
        means=jnp.asarray(np.asarray(gaussians.means, np.float64) @ rotation.T, jnp.float32),
        quats=jnp.asarray(quats_from_matrix(rotation @ axes), jnp.float32),
        sh=jnp.asarray(np.einsum("ij,njc->nic", mixing, np.asarray(gaussians.sh, np.float64)), jnp.float32),
    )


def sh_rotation(rotation: np.ndarray, count: int) -> np.ndarray:
    """The matrix (count, count) that rotates coefficients by `rotation` (3, 3): what Y(R d) M c = Y(d) c asks for at
    more rays d than there are coefficients. It leaves each degree to itself."""
    rays = np.random.default_rng(0).standard_normal((_RAYS, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    before, after = (np.asarray(basis(jnp.asarray(r), count), np.float64) for r in (rays, rays @ rotation.T))
    return np.linalg.lstsq(after, before, rcond=None)[0]
