"""Laws of seamless sampling on the sphere."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.pinhole import pinhole_rays
from rein3d_jax.geometry.poses import pinhole_camera, rigid, upright
from rein3d_jax.geometry.resample import pad_sphere, perspective_crop, sample_sphere, sample_sphere_cubic
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.sphere import pixel_rays, pixels_from_rays, world_from_camera_axes

HEIGHT, WIDTH = 8, 16
IMAGE = jax.random.uniform(jax.random.key(0), (HEIGHT, WIDTH, 3))


def sky(rays: jax.Array) -> jax.Array:
    """A smooth picture on unit rays, with no symmetry that could hide a turn or a flip."""
    x, y, z = jnp.moveaxis(rays, -1, 0)
    return jnp.stack([0.5 + 0.4 * x, 0.5 + 0.3 * y + 0.2 * x * z, 0.5 + 0.4 * z], axis=-1)


def test_pixel_centres_come_back() -> None:
    u, v = jnp.meshgrid(jnp.arange(WIDTH) + 0.5, jnp.arange(HEIGHT) + 0.5)
    np.testing.assert_allclose(sample_sphere(IMAGE, u, v), IMAGE, atol=1e-6)  # one float32 lerp


def test_cubics_keep_pixels_and_parabolas_and_cross_the_seam() -> None:
    u, v = jnp.meshgrid(jnp.arange(WIDTH) + 0.5, jnp.arange(HEIGHT) + 0.5)
    np.testing.assert_allclose(sample_sphere_cubic(IMAGE, u, v), IMAGE, atol=1e-6)  # one float32 lerp
    inside = jnp.linspace(3, HEIGHT - 3, 20)  # two pixels from a pole
    parabola = (jnp.arange(HEIGHT) + 0.5)[:, None, None] ** 2 * jnp.ones((1, WIDTH, 1))
    found = sample_sphere_cubic(parabola, jnp.full(20, 5.3), inside)[:, 0]
    np.testing.assert_allclose(found, inside**2, rtol=1e-5)  # float32 sums of 16 terms
    v = jnp.linspace(0, HEIGHT, 20)
    left, right = (sample_sphere_cubic(IMAGE, jnp.full(20, u), v) for u in (0.0, WIDTH))
    np.testing.assert_allclose(left, right, atol=1e-5)


def test_padding_is_the_picture_seen_past_its_edges() -> None:
    padded = pad_sphere(IMAGE, 2)
    np.testing.assert_array_equal(padded[2:-2, 2:-2], IMAGE)
    np.testing.assert_array_equal(padded[2:-2, :2], IMAGE[:, -2:])
    np.testing.assert_array_equal(padded[2:-2, -2:], IMAGE[:, :2])
    np.testing.assert_array_equal(padded[1, 2:-2], jnp.roll(IMAGE[0], WIDTH // 2, axis=0))  # nearest row first
    np.testing.assert_array_equal(padded[-1, 2:-2], jnp.roll(IMAGE[-2], WIDTH // 2, axis=0))
    np.testing.assert_array_equal(pad_sphere(IMAGE, 0), IMAGE)


def test_seam_is_one_place() -> None:
    v = jnp.linspace(0, HEIGHT, 20)
    left, right = sample_sphere(IMAGE, jnp.zeros(20), v), sample_sphere(IMAGE, jnp.full(20, WIDTH), v)
    np.testing.assert_allclose(left, right, atol=1e-6)  # the same lerp from either end


@pytest.mark.parametrize("v", [0.0, HEIGHT])
def test_pole_is_the_same_from_opposite_columns(v: float) -> None:
    u = jnp.linspace(0, WIDTH / 2, 20)
    here, there = sample_sphere(IMAGE, u, jnp.full(20, v)), sample_sphere(IMAGE, u + WIDTH / 2, jnp.full(20, v))
    np.testing.assert_allclose(here, there, atol=1e-6)


def test_constants_stay_constant_everywhere() -> None:
    u, v = jax.random.uniform(jax.random.key(1), (2, 500))
    values = sample_sphere(jnp.full((HEIGHT, WIDTH), 0.7), u * WIDTH, v * HEIGHT)
    np.testing.assert_allclose(values, 0.7, atol=1e-6)


def test_yawed_picture_gives_yawed_samples() -> None:
    u, v = jax.random.uniform(jax.random.key(2), (2, 500))
    u, v = u * WIDTH, v * HEIGHT
    rolled = sample_sphere(jnp.roll(IMAGE, 5, axis=1), jnp.mod(u + 5, WIDTH), v)
    np.testing.assert_allclose(rolled, sample_sphere(IMAGE, u, v), atol=1e-5)  # u + 5 loses 2 bits, slopes up to 1


def test_sampling_a_smooth_sky_is_second_order() -> None:
    """Bilinear error is at most step^2 / 8 x the second derivative (below 1 here), in each of two coordinates."""
    rays = jax.random.normal(jax.random.key(3), (500, 3))
    rays /= jnp.linalg.norm(rays, axis=-1, keepdims=True)
    values = sample_sphere(sky(pixel_rays(64, 128)), *pixels_from_rays(rays, 64, 128))
    np.testing.assert_allclose(values, sky(rays), atol=2 * (np.pi / 64) ** 2 / 8)


@pytest.mark.parametrize("turn", [None, (0.9, 0.1, -0.3, 0.4)])
def test_crop_equals_a_direct_trace_of_the_sky(turn: tuple | None) -> None:
    """Whatever way the panorama itself was turned, the crop shows what stands in the world."""
    rotation = jnp.eye(3) if turn is None else matrix_from_quats(jnp.array(turn))
    world_from_panorama = rigid(rotation @ world_from_camera_axes(), jnp.zeros(3))
    panorama = sky(pixel_rays(64, 128) @ rotation.T)
    camera = pinhole_camera(upright(jnp.zeros(3), 2.5, 0.6), 24, np.pi / 2)
    rays = pinhole_rays(24, 24, camera.focal, camera.centre) @ camera.world_from_camera[:3, :3].T
    expected = sky(rays / jnp.linalg.norm(rays, axis=-1, keepdims=True))
    crop = perspective_crop(panorama, world_from_panorama, camera)
    np.testing.assert_allclose(crop, expected, atol=2 * (np.pi / 64) ** 2 / 8)  # the bilinear bound above
