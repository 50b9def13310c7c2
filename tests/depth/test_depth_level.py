"""Laws of levelling: the lean that was put in is found, with its sign, and taken out again; what is not plain stays."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.level import (
    LEANED,
    NOT_ASKED,
    NOT_TOLD,
    STOOD_LEVEL,
    Lean,
    estimate_lean,
    level_panorama,
    levelled,
    unasked_lean,
)
from rein3d_jax.depth.picture_edges import sharp_gradients
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.shell import RoomShell, meet_shell, world_from_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.scene import Panorama

H = 128
ROOM = RoomShell(*(jnp.asarray(x) for x in (0.3, (2.2, 1.8, 2.4, 1.6), 1.5, 1.2)))
UP = np.array([0.0, 0.0, 1.0])


def tilt(roll, pitch):
    """The rotation room_from_picture of a camera that leaned to its right by `roll` and up by `pitch` degrees."""
    quats = [[np.cos(a / 2), *(np.sin(a / 2) * np.array(axis))] for a, axis in
             ((np.radians(pitch), (0, -1.0, 0)), (np.radians(roll), (1.0, 0, 0)))]  # fmt: skip
    return np.asarray(matrix_from_quats(jnp.array(quats[0])) @ matrix_from_quats(jnp.array(quats[1])), np.float64)


def seen(room_from_picture, height=H):
    """A box room with panels on its faces, through 4 x 4 rays a pixel: what a camera in that orientation takes."""
    rays = pixel_rays(4 * height, 8 * height) @ jnp.asarray(room_from_picture.T, jnp.float32)
    distance, face = meet_shell(ROOM, jnp.zeros(3), rays)
    points = distance[..., None] * rays @ world_from_shell(ROOM)
    panels = jnp.sum(jnp.floor(points / 0.7 + 0.01), axis=-1) % 2
    shade = (0.3 + 0.08 * face + 0.15 * panels)[..., None] * jnp.array([1.0, 0.9, 0.8])
    return shade.reshape(height, 4, 2 * height, 4, 3).mean((1, 3))


def degrees_between(a, b):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b)), np.dot(a, b)))


@pytest.mark.parametrize(("roll", "pitch"), [(6.0, 0.0), (0.0, -6.0), (-9.0, 4.0), (12.0, 12.0)])
def test_a_lean_is_found_with_its_signs(roll, pitch):
    """To the camera's right is a positive roll, upwards a positive pitch; they name the same up."""
    true = tilt(roll, pitch)
    lean = estimate_lean(seen(true))
    assert lean.verdict == LEANED and f"{lean.degrees:.1f} degrees" in lean.sentence
    # Half a pixel of 128 rows is 0.7 degrees; hundreds of edges share it.
    assert degrees_between(lean.up, true.T @ UP) < 0.5
    np.testing.assert_allclose((lean.roll, lean.pitch), (roll, pitch), atol=0.6)


def test_the_camera_s_right_goes_down_with_a_positive_roll_and_its_front_up_with_a_positive_pitch():
    assert (tilt(10, 0) @ [0, -1.0, 0])[2] < 0 and (tilt(0, 10) @ [1.0, 0, 0])[2] > 0
    lean = Lean(jnp.asarray(tilt(10, 5).T @ UP, jnp.float32), jnp.array(1.0))
    np.testing.assert_allclose((lean.roll, lean.pitch), (10, 5), atol=1e-3)  # float32


def test_a_level_picture_is_left_alone_bit_for_bit():
    panorama = Panorama(seen(np.eye(3)), jnp.ones((H, 2 * H)), jnp.ones((H, 2 * H), bool))
    lean = estimate_lean(panorama.rgb)
    assert lean.verdict == STOOD_LEVEL
    assert levelled(panorama, lean) is panorama
    np.testing.assert_array_equal(lean.level_from_picture, np.eye(3))


@pytest.mark.parametrize("picture", ["flat", "noise", "grey levels"])
def test_without_lines_nothing_is_told_and_nothing_done(picture):
    noise = jax.random.uniform(jax.random.key(1), (H, 2 * H, 3))
    rgb = {"flat": 0 * noise + 0.5, "noise": noise, "grey levels": 0.5 + noise / 255}[picture]
    lean = estimate_lean(rgb)
    assert lean.verdict == NOT_TOLD and np.isfinite(lean.up).all()
    panorama = Panorama(rgb, rgb[..., 0], rgb[..., 0] > 2)
    assert levelled(panorama, lean) is panorama


def test_a_yaw_of_the_camera_turns_the_up_with_it():
    picture = seen(tilt(5, 3))
    first, second = (
        estimate_lean(picture).up,
        estimate_lean(jnp.roll(picture, H // 2, axis=1)).up,
    )  # a quarter to the right
    # Steps of 0.05 degrees, taken along axes of the picture.
    assert degrees_between(second, [first[1], -first[0], first[2]]) < 0.2


def test_levelled_is_what_a_level_camera_takes():
    true = tilt(-7, 5)
    lean = Lean(jnp.asarray(true.T @ UP, jnp.float32), jnp.array(1.0))
    rotation = np.asarray(lean.level_from_picture, np.float64)
    np.testing.assert_allclose(rotation @ (true.T @ UP), UP, atol=1e-6)  # float32
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
    heading = rotation @ true.T  # what is left is a yaw
    leaning = Panorama(seen(true), jnp.ones((H, 2 * H)), jnp.ones((H, 2 * H), bool))
    error = np.abs(levelled(leaning, lean).rgb - seen(heading.T))
    assert np.mean(error) < 0.01  # only edges differ, by the step's overshoot and blur
    assert np.mean(error) < 0.25 * np.mean(np.abs(leaning.rgb - seen(heading.T)))


def test_distances_stay_values_of_the_map_and_come_back():
    true = tilt(8, -3)
    lean = Lean(jnp.asarray(true.T @ UP, jnp.float32), jnp.array(1.0))

    def distances(room_from_picture):
        return meet_shell(ROOM, jnp.zeros(3), pixel_rays(H, 2 * H) @ jnp.asarray(room_from_picture.T, jnp.float32))[0]

    distance = distances(true)
    valid = jnp.ones(distance.shape, bool).at[40:60, 20:50].set(False)
    panorama = Panorama(jnp.zeros((H, 2 * H, 3)), distance, valid)
    found = levelled(panorama, lean)
    assert np.isin(found.distance, distance).all()
    level = distances(true @ np.asarray(lean.level_from_picture).T)
    np.testing.assert_allclose(found.distance, level, rtol=0.06)  # a pixel's diagonal of 2 degrees, at 50 to a wall
    share = float(jnp.mean(valid[: H // 2])), float(jnp.mean(found.valid[: H // 2]))
    assert abs(share[0] - share[1]) < 0.02  # the hole moves, and does not grow
    back = level_panorama(found, lean.level_from_picture.T)
    np.testing.assert_allclose(back.distance, distance, rtol=0.12)  # twice a pixel


def test_a_rotation_by_columns_is_a_roll():
    key = jax.random.key(0)
    panorama = Panorama(
        jax.random.uniform(key, (16, 32, 3)), jax.random.uniform(key, (16, 32)), jnp.ones((16, 32), bool)
    )
    quarter = jnp.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # +X to -Y: to the right
    found = level_panorama(panorama, quarter)
    np.testing.assert_allclose(found.rgb, jnp.roll(panorama.rgb, 8, axis=1), atol=1e-4)  # pixels of 1e-5, float32


def test_nobody_asked():
    assert unasked_lean().verdict == NOT_ASKED and "as was asked" in unasked_lean().sentence
    np.testing.assert_array_equal(unasked_lean().level_from_picture, np.eye(3))


@pytest.mark.parametrize("degrees", [5.0, 15.0, 40.0])
def test_five_taps_tell_the_direction_of_a_wave(degrees):
    """Of a wave of 8 pixels, at the equator: tan of its direction within 2 %; two taps are off by up to 8."""
    angle, (rows, columns) = np.radians(degrees), np.mgrid[:64, :128]
    wave = np.sin(2 * np.pi / 8 * (columns * np.cos(angle) - rows * np.sin(angle)))[..., None]
    east, north = sharp_gradients(jnp.asarray(wave, jnp.float32))
    middle = (slice(30, 34), slice(8, -8))
    slope = np.sum(np.asarray(east * north)[middle]) / np.sum(np.asarray(east**2)[middle])
    np.testing.assert_allclose(slope, np.tan(angle), rtol=0.02)
