"""A field fused from exact panoramas of a box holds the distance to its walls."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.signed_distance import TRUNCATION, blank_field, fuse
from rein3d_jax.geometry.sphere import rays_of_pose

BOX = np.array([1.6, 1.2, 0.9])  # half sizes, metres
VOXEL = 0.1
EYES = ((0.0, 0.0, 0.0, 0.0), (0.8, -0.4, 0.2, 1.0))  # x, y, z, yaw


@pytest.fixture(scope="module")
def field():
    shape = tuple(int(n) for n in np.ceil(2 * (BOX + 0.6) / VOXEL))
    result = blank_field(-(BOX + 0.6), shape, VOXEL)
    for *eye, yaw in EYES:
        pose = upright(jnp.array(eye), yaw)
        rays = np.asarray(rays_of_pose(pose, 64, 128))
        distance = ((np.sign(rays) * BOX - eye) / rays).min(axis=-1)
        result = fuse(result, jnp.asarray((rays + 1) / 2), jnp.asarray(distance), pose)
    return result


def wall_distance(field):
    """(x, y, z) metres to the nearest wall, positive within, and how many walls a sample lies behind."""
    axes = [np.asarray(field.low)[a] + np.arange(n) * VOXEL for a, n in enumerate(field.known.shape)]
    gaps = BOX - np.abs(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1))
    return gaps.min(axis=-1), (gaps < 0).sum(axis=-1)


def test_it_is_positive_within_and_negative_just_behind(field):
    distance, behind = wall_distance(field)
    known, signed = np.asarray(field.known), np.asarray(field.signed)
    within = distance > VOXEL / 2
    assert known[within].mean() > 0.95  # along edges of the box four pixels lie on two walls
    assert (signed[within & known] > 0).all()
    just = (behind == 1) & (distance < -VOXEL / 2) & known
    assert just.any() and (signed[just] < 0).all()


def test_far_behind_a_wall_nothing_is_known(field):
    distance, _ = wall_distance(field)
    assert not np.asarray(field.known)[distance < -(TRUNCATION + 0.5) * VOXEL].any()


def test_unknown_pixels_say_nothing():
    empty = fuse(blank_field([-1, -1, -1], (4, 4, 4), 0.5), jnp.ones((8, 16, 3)), jnp.zeros((8, 16)), jnp.eye(4))
    assert not np.asarray(empty.known).any() and np.isfinite(np.asarray(empty.signed)).all()
