"""Depth edges: ramps become steps, surfaces stay."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.lift import LiftConfig
from rein3d_jax.lift.edges import snap_edges

HEIGHT, WIDTH = 192, 384  # the least width at which the default ramp is not shortened
NEAR = 2.0


@partial(jax.jit, static_argnames=("ramp",))
def snapped(distance: jax.Array, valid: jax.Array, ramp: int = LiftConfig.edge_ramp) -> jax.Array:
    return snap_edges(distance, valid, ramp=ramp, step=LiftConfig.edge_step, slope=LiftConfig.edge_slope)


def snap(distance: np.ndarray) -> np.ndarray:
    return np.asarray(snapped(jnp.asarray(distance, jnp.float32), jnp.asarray(distance) > 0))


def blurred(image: np.ndarray, kernel: np.ndarray, axis: int) -> np.ndarray:
    reach = len(kernel) // 2
    return sum(weight * np.roll(image, k - reach, axis=axis) for k, weight in enumerate(kernel))


def gaussian(sigma: float) -> np.ndarray:
    x = np.arange(-12, 13)
    kernel = np.exp(-0.5 * (x / sigma) ** 2)
    return kernel / kernel.sum()


def box_room(half: np.ndarray, centre: np.ndarray, height: int = HEIGHT) -> np.ndarray:
    rays = np.asarray(pixel_rays(height, 2 * height), np.float64)
    with np.errstate(divide="ignore"):
        return np.min((np.sign(rays) * half - centre) / rays, axis=-1)


def off_both(distance: np.ndarray, far: float) -> float:
    """Share of pixels more than 2 % from both surfaces; a flying splat is tens of per cent away."""
    return np.mean((np.abs(distance / NEAR - 1) > 0.02) & (np.abs(distance / far - 1) > 0.02))


@pytest.mark.parametrize("ratio", [1.3, 2.0, 5.0])
@pytest.mark.parametrize("kernel", [np.ones(1), np.ones(2) / 2, np.ones(3) / 3, *map(gaussian, (1, 2, 3))])
def test_blurred_step_becomes_a_step(kernel: np.ndarray, ratio: float) -> None:
    sharp = np.full((HEIGHT, WIDTH), NEAR * ratio)
    sharp[:, WIDTH - 60 :] = NEAR
    sharp[:, :40] = NEAR  # the near surface lies across the seam
    soft = blurred(sharp, kernel, axis=1)
    if len(kernel) > 1:
        assert off_both(soft, NEAR * ratio) > 0.002  # one pixel at each of the two edges: there is something to mend
    result = snap(soft)
    assert off_both(result, NEAR * ratio) < 0.002
    # A symmetric ramp of inverse distance would be cut in its middle; one of distance is cut nearer the near side.
    moved_edge = np.mean(np.abs(result / sharp - 1) > 0.02) * WIDTH / 2
    assert moved_edge <= (0 if len(kernel) == 1 else 3.5)  # pixels an edge: 0.97 sigma = 2.9 at ratio 5, and rounding


def test_blurred_step_along_a_column_and_over_the_pole() -> None:
    """The near surface is a cap about a point 10 degrees off the zenith, so the edge runs over the pole."""
    axis = np.array([np.sin(0.17), 0, np.cos(0.17)])
    angle = np.arccos(np.asarray(pixel_rays(HEIGHT, WIDTH), np.float64) @ axis)
    width = 2 * np.pi / HEIGHT  # a ramp of two pixels either side
    soft = NEAR * (1 + np.clip((angle - 0.6) / (2 * width) + 0.5, 0, 1))
    assert off_both(soft, 2 * NEAR) > 0.005
    assert off_both(snap(soft), 2 * NEAR) < 0.001


def test_thin_objects_stay() -> None:
    distance = np.full((HEIGHT, WIDTH), 4.0)
    for pixels, at in ((1, 50), (2, 100), (3, 150), (6, 200)):
        distance[:, at : at + pixels] = 1.5
    np.testing.assert_array_equal(snap(distance), distance.astype(np.float32))


@pytest.mark.parametrize("height", [16, 32, 192])
def test_empty_rooms_stay(height: int) -> None:
    """Long, high and off-centre boxes: grazing floors, creases and corners."""
    for half, centre in (((3, 2, 1.4), (1, -1, 0.2)), ((8, 1, 1.3), (5, 0.5, -0.4)), ((2, 2, 2), (0, 0, 0))):
        distance = box_room(np.array(half), np.array(centre), height).astype(np.float32)
        result = snap(distance)
        assert np.mean(result != distance) < 0.01  # few coarse pixels, beside a crease
        np.testing.assert_allclose(result, distance, rtol=0.1)


def test_planes_and_spheres_stay() -> None:
    rays = np.asarray(pixel_rays(HEIGHT, WIDTH), np.float64)
    normal = np.array([0.6, -0.3, -0.74])
    towards = rays @ normal / np.linalg.norm(normal)
    plane = np.where(towards > 0.02, 1.6 / np.maximum(towards, 0.02), 0)  # seen down to a grazing 1 degree
    along = rays @ np.array([2.0, 1.0, 0.5])
    sphere = along + np.sqrt(along**2 + 9 - 5.25)  # radius 3, seen from inside, off centre
    for distance in (plane, sphere):
        np.testing.assert_array_equal(snap(distance), distance.astype(np.float32))


def test_ramp_on_a_floor_goes_to_the_floor() -> None:
    """The surface beside a ramp is followed along its slope, not held flat."""
    room = box_room(np.array([3, 3, 1.5]), np.zeros(3))
    rays = np.asarray(pixel_rays(HEIGHT, WIDTH), np.float64)
    post = (np.abs(rays[..., 1] / rays[..., 0]) < 0.4) & (rays[..., 0] > 0)  # a screen 0.9 m ahead, floor to ceiling
    screen = 0.9 / np.maximum(rays[..., 0], 0.1)
    soft = blurred(np.where(post, screen, room), gaussian(1), axis=1)
    band = slice(int(0.65 * HEIGHT), int(0.8 * HEIGHT))  # rows where the far side is floor

    def off(distance: np.ndarray) -> float:
        return np.mean(np.minimum(np.abs(distance / room - 1), np.abs(distance / screen - 1))[band] > 0.03)

    assert off(soft) > 0.01
    assert off(snap(soft)) < 0.001


def test_invalid_pixels_are_neither_moved_nor_used() -> None:
    distance = box_room(np.array([3, 2, 1.4]), np.zeros(3)).astype(np.float32)
    valid = np.random.default_rng(0).uniform(size=distance.shape) > 0.3
    valid[40:60, 50:80] = False
    holes = np.where(valid, distance, 77.0).astype(np.float32)
    np.testing.assert_array_equal(snapped(jnp.asarray(holes), jnp.asarray(valid)), holes)
    nothing = jnp.zeros((HEIGHT, WIDTH), bool)
    np.testing.assert_array_equal(snapped(jnp.asarray(holes), nothing), holes)


def test_yaw_and_scale_commute() -> None:
    soft = np.full((HEIGHT, WIDTH), 5.0)
    soft[60:130, 100:250] = 2.0
    soft = blurred(blurred(soft, gaussian(1), 0), gaussian(1), 1)
    result = snap(soft)
    np.testing.assert_array_equal(snap(np.roll(soft, 137, axis=1)), np.roll(result, 137, axis=1))
    np.testing.assert_array_equal(snap(4 * soft), 4 * result)  # powers of two: no rounding


def furnished(rays: np.ndarray) -> np.ndarray:
    """A box room with a table's top, seen nearly edge-on: 0.15 m below the eye, 1.2 to 2.6 m away."""
    room = box_room(np.array([3.5, 3, 1.5]), np.zeros(3))
    top = np.where(rays[..., 2] < 0, -0.15 / np.minimum(rays[..., 2], -1e-9), np.inf)
    x, y = top * rays[..., 0], top * rays[..., 1]
    return np.where((np.abs(x - 1.9) < 0.7) & (np.abs(y) < 0.5), top, room)


def test_a_rendered_map_stays(monkeypatch) -> None:
    """The top is a narrow peak of slope, as a ramp is: only the steps elsewhere tell that nothing was blurred."""
    distance = furnished(np.asarray(pixel_rays(HEIGHT, WIDTH), np.float64))
    np.testing.assert_array_equal(snap(distance), distance.astype(np.float32))
    monkeypatch.setattr("rein3d_jax.lift.edges._widest", lambda climb: 100)  # every peak is a ramp: the top is one
    harmed = snap_edges(jnp.asarray(distance, jnp.float32), jnp.asarray(distance) > 0, ramp=24, step=0.1, slope=0.01)
    assert np.mean(np.asarray(harmed) != distance.astype(np.float32)) > 0.001
