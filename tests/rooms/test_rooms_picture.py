"""Laws of the traced picture: yaw, shadows, filtering, platforms."""

import jax
import jax.export
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.tracing.trace import trace

HEIGHT = 64


def psnr(a, b):
    return -10 * np.log10(np.mean((np.asarray(a) - np.asarray(b)) ** 2))


def test_yawing_by_whole_pixels_rolls_the_panorama(room_of, tracer, pose_at):
    columns = 17
    yawed = pose_at(0.1, 0.0, 0.0, right=columns * np.pi / HEIGHT)
    view = tracer(room_of(2), jnp.stack([pose_at(0.1, 0.0, 0.0), yawed]), HEIGHT)
    for name, atol in (("rgb", 1 / 255), ("distance", 1e-4), ("object", 0)):
        first, second = (np.asarray(getattr(view, name)[i]) for i in (0, 1))
        off = np.abs(np.roll(first, -columns, axis=1) - second) > atol
        # Rays rotated by float32 sines may fall on the other side of an edge or of a texture's cell.
        assert off.mean() < 5e-3, name


def test_frames_are_traced_alone(room_of, tracer, pose_at):
    """A frame's bytes do not depend on the others'."""
    one, two, three = (pose_at(0.1 * i)[None] for i in range(3))
    first, second = (
        tracer(room_of(1), jnp.concatenate([one, two]), HEIGHT),
        tracer(room_of(1), jnp.concatenate([two, three]), HEIGHT),
    )
    jax.tree.map(lambda a, b: np.testing.assert_array_equal(a[1], b[0]), first, second)


def test_a_box_under_a_lamp_leaves_a_shadow_and_only_there(room_of, tracer, pose_at, without_solids):
    """One lamp overhead, a plate between it and the floor: dark below the plate, unchanged far from it."""
    bare = without_solids(room_of(4))
    power = jnp.zeros_like(bare.lights.power).at[0].set(1.0)
    lamp = bare.lights.replace(
        power=power,
        position=bare.lights.position.at[0].set(jnp.array([0.0, 0.0, 0.4])),
        radius=jnp.full(3, 0.05, jnp.float32),
    )
    bare = bare.replace(lights=lamp, ambient=0.02 * jnp.ones((2, 3)), exposure=jnp.float32(4.0))
    plate = bare.boxes.replace(
        centre=bare.boxes.centre.at[0].set(jnp.array([0.3, 0.0, -0.7])),
        half=bare.boxes.half.at[0].set(jnp.array([0.2, 0.2, 0.02])),
        heading=bare.boxes.heading.at[0].set(jnp.array([1.0, 0.0])),
        count=jnp.int32(1),
        casters=jnp.int32(1),
    )
    pose = pose_at(0.0, 0.0, -1.0)
    lit, shaded = (tracer(r, pose[None], HEIGHT) for r in (bare, bare.replace(boxes=plate)))
    floor = (np.asarray(lit.object[0]) == 0) & (np.asarray(shaded.object[0]) == 0)
    ratio = np.asarray(shaded.rgb[0]).mean(-1) / np.asarray(lit.rgb[0]).mean(-1)
    # The plate's middle, seen from the lamp, falls on the floor at x = 0.3 * 2.0 / 1.1 = 0.55 m.
    yaw = float(bare.yaw)
    azimuth = -yaw  # the room's +x in the panorama, turning right
    column = int((azimuth / (2 * np.pi) + 0.5) * 2 * HEIGHT) % (2 * HEIGHT)
    row = int((0.5 + np.arctan2(0.6, 0.55) / np.pi) * HEIGHT)
    assert floor[row, column] and ratio[row, column] < 0.5
    behind = (column + HEIGHT) % (2 * HEIGHT)
    assert floor[row, behind] and ratio[row, behind] > 0.95


@pytest.mark.slow
@pytest.mark.parametrize("index", range(3))
def test_textures_hold_nothing_finer_than_pixels(index, room_of, tracer, pose_at, without_solids):
    """One ray a pixel equals the mean of 4 x 4, which is a panorama of 256 rows averaged over areas.
    Measured on 24 rooms: 31.9-39.5 dB, with the silhouettes of corners and windows, which nothing filters."""
    bare, pose = without_solids(room_of(index)), pose_at()[None]
    one, many = tracer(bare, pose, HEIGHT), tracer(bare, pose, HEIGHT, samples=4)
    assert psnr(one.rgb[0], many.rgb[0]) > 30
    np.testing.assert_allclose(one.distance, many.distance, atol=1e-5)  # the same rays, compiled twice


def test_it_exports_for_every_platform(pose_at):
    """Nothing in it is bound to a platform."""

    def panorama(key, poses):
        return trace(generate_room(key), poses, 16)

    key = jax.ShapeDtypeStruct((2,), jnp.uint32)
    poses = jax.ShapeDtypeStruct((2, 4, 4), jnp.float32)
    exported = jax.export.export(jax.jit(panorama), platforms=["cpu", "cuda", "tpu"])(key, poses)
    assert set(exported.platforms) == {"cpu", "cuda", "tpu"}
