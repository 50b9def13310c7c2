"""The floor is found, and with it the scale, whatever hides most of it."""

import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.depth.room_shell import shell_distance
from rein3d_jax.depth.scale import height_above_floor
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import RoomShell
from rein3d_jax.geometry.sphere import latitudes, pixel_rays
from rein3d_jax.scene import Panorama

HEIGHT, EYE = 64, 1.6
RNG = np.random.default_rng(0)
EXACT = 1e-3  # of a noiseless floor: float32 distances, and a median among equal drops


def box(walls=(2.0, 1.5, 3.0, 2.5), eye=EYE):
    """An empty room (h, w)."""
    shell = RoomShell(jnp.float32(0.3), jnp.array(walls), jnp.float32(eye), jnp.float32(1.0))
    return np.asarray(shell_distance(shell, HEIGHT, 2 * HEIGHT))


def seen(distance, valid=None):
    return Panorama(None, distance, np.ones(distance.shape, bool) if valid is None else valid)


def with_top(distance, top, spans):
    """The room with horizontal tops `top` metres below the camera over the columns `spans`."""
    down = -np.asarray(pixel_rays(HEIGHT, 2 * HEIGHT))[..., 2]
    over = np.where(down > 0.1, top / np.maximum(down, 0.1), np.inf)
    columns = np.zeros(2 * HEIGHT, bool)
    for span in spans:
        columns[span] = True
    return np.where(columns & (over < distance), over, distance)


@pytest.mark.parametrize("factor", [1e-3, 0.3, 7.0, 255.0])
def test_a_map_of_any_unit_is_brought_to_the_same_scale(factor):
    assert height_above_floor(seen(box() * factor)) == pytest.approx(EYE * factor, rel=EXACT)


@pytest.mark.parametrize("walls", [(0.6, 0.6, 8.0, 8.0), (0.8, 0.9, 0.8, 0.9), (5.0, 5.0, 5.0, 5.0)])
def test_corridors_cupboards_and_halls(walls):
    assert height_above_floor(seen(box(walls))) == pytest.approx(EYE, rel=EXACT)


def test_beds_and_tables_over_most_of_it():
    """Tops over two thirds of the columns, at two heights."""
    furnished = with_top(with_top(box(), 1.1, [np.s_[:50]]), 0.85, [np.s_[60:95]])
    assert height_above_floor(seen(furnished)) == pytest.approx(EYE, rel=EXACT)


def test_a_tripod_s_disc_and_a_hole_at_the_nadir():
    down = -np.degrees(np.asarray(latitudes(HEIGHT)))[:, None]
    disc = np.where(down > 60, 0.5 * box(), box())
    assert height_above_floor(seen(disc)) == pytest.approx(EYE, rel=EXACT)
    hole = np.broadcast_to(down < 55, disc.shape) & (RNG.random(disc.shape) < 0.9)
    assert height_above_floor(seen(np.where(hole, box(), np.nan), hole)) == pytest.approx(EYE, rel=EXACT)


def test_noise_and_waves_of_an_estimator():
    azimuth = np.linspace(0, 2 * np.pi, 2 * HEIGHT, endpoint=False)
    waved = box() * np.exp(0.04 * np.sin(5 * azimuth) + 0.01 * RNG.standard_normal((HEIGHT, 2 * HEIGHT)))
    # Half the waves' height: the lowest of what is strong is taken, and that leans to their troughs.
    assert height_above_floor(seen(waved)) == pytest.approx(EYE, rel=0.02)


def test_no_floor_is_refused():
    above = np.broadcast_to(np.asarray(latitudes(HEIGHT))[:, None] > -0.3, (HEIGHT, 2 * HEIGHT))
    tube = 2 / np.maximum(np.cos(np.asarray(latitudes(HEIGHT))), 1e-3)[:, None] * np.ones((1, 2 * HEIGHT))
    for panorama in (seen(box(), above), seen(tube), seen(box(), np.zeros_like(above))):
        with pytest.raises(InputError, match="shows no floor"):
            height_above_floor(panorama)
