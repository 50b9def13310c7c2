"""Every beginning of a scene in detail order is the whole scene, coarser; grown, a part of it nearly is the whole."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.geometry.spherical_harmonics import sh_from_rgb
from rein3d_jax.lift.detail_order import in_detail_order, lighter_scene
from rein3d_jax.rasterize import RasterizeConfig
from rein3d_jax.rasterize.reference import rasterize_reference
from rein3d_jax.scene import Gaussians

ROWS = 48
SIZE = 24  # pixels: a splat is about as wide as one
FIELDS = ("means", "log_scales", "quats", "opacity_logits", "sh")


@pytest.fixture(scope="module")
def room():
    """A box of 4 x 3 x 2.4 m, striped, as flat splats on the rows of a panorama from inside it, as one is lifted."""
    elevation = (0.5 - (np.arange(ROWS) + 0.5) / ROWS) * np.pi
    azimuth = -((np.arange(2 * ROWS) + 0.5) / (2 * ROWS) - 0.5) * 2 * np.pi
    up, left = (grid.ravel() for grid in np.meshgrid(elevation, azimuth, indexing="ij"))
    rays = np.stack([np.cos(up) * np.cos(left), np.cos(up) * np.sin(left), np.sin(up)], axis=1)
    reach = np.array([2.0, 1.5, 1.2]) / np.abs(rays)
    distance = reach.min(axis=1)
    means = distance[:, None] * rays
    thin = np.arange(3) == reach.argmin(axis=1)[:, None]
    scales = np.where(thin, 1e-3, 0.75 * distance[:, None] * np.pi / ROWS)
    rgb = 0.5 + 0.4 * np.sin(means @ np.array([[2.0, 0, 1], [1, 2, 0], [0, 1, 3]]))
    quats = np.tile([1.0, 0, 0, 0], (len(means), 1))
    fields = (means, np.log(scales), quats, np.full(len(means), 4.0), np.asarray(sh_from_rgb(rgb))[:, None])
    return Gaussians(*(jnp.asarray(field, jnp.float32) for field in fields), jnp.ones(len(means), bool))


@jax.jit
def picture(scene):
    camera = pinhole_camera(upright(jnp.zeros(3), 0.4), SIZE, math.pi / 2)
    rgb, alpha, _ = rasterize_reference(scene, camera, config=RasterizeConfig())
    return jnp.clip(rgb + 0.5 * (1 - alpha[..., None]), 0, 1)


def likeness(part, whole):
    """PSNR from the panorama's place; dead slots keep one shape, and so one program."""
    spare = len(whole.alive) - len(part.alive)
    part = jax.tree.map(lambda field: jnp.pad(field, [(0, spare)] + [(0, 0)] * (field.ndim - 1)), part)
    part = part.replace(quats=part.quats.at[:, 0].add(jnp.where(part.alive, 0.0, 1.0)))
    return -10 * np.log10(np.mean((picture(part) - picture(whole)) ** 2))


def beginning(scene, count):
    return jax.tree.map(lambda field: field[:count], scene)


@pytest.mark.parametrize(("share", "random_margin", "grown_gain"), [(0.1, 0.2, 0.6), (0.25, 1, 2), (0.5, 1.5, 2)])
def test_a_beginning_is_the_whole_scene_coarser(room, share, random_margin, grown_gain):
    """In dB, half of what was measured or less. A tenth is mostly holes, whichever it is."""
    count = int(share * len(room.alive))
    mixed = np.random.default_rng(0).permutation(len(room.alive))
    random = likeness(beginning(jax.tree.map(lambda field: field[mixed], room), count), room)
    ours = likeness(beginning(in_detail_order(room), count), room)
    assert ours > random + random_margin and ours > likeness(beginning(room, count), room) + 1
    assert likeness(lighter_scene(room, count), room) > ours + grown_gain


def test_the_whole_is_what_it_was(room):
    """The same splats, the dead ones left out, so that it looks the same; a scene that is light enough is itself."""
    some = room.replace(alive=jnp.arange(len(room.alive)) % 3 > 0)
    got = in_detail_order(some)
    order = np.lexsort(np.asarray(got.means).T), np.lexsort(np.asarray(some.means[some.alive]).T)
    assert got.alive.all() and len(got.alive) == int(some.alive.sum())
    for name in FIELDS:
        ours, theirs = np.asarray(getattr(got, name)), np.asarray(getattr(some, name))[some.alive]
        np.testing.assert_array_equal(ours[order[0]], theirs[order[1]], err_msg=name)
    assert lighter_scene(some, len(got.alive)) is some


def widths_by_place(scene):
    widths = np.sort(np.exp(np.asarray(scene.log_scales, np.float64)), axis=1)
    return widths[np.lexsort(np.asarray(scene.means).T)]


@pytest.mark.parametrize("count", [1, 2, 100])
def test_a_lighter_scene_covers_as_much(room, count):
    """The two longer axes grow, so that n splats have the area that all had, and the shortest stays."""
    some = lighter_scene(room, count)
    assert len(some.alive) == count
    widths, before = (widths_by_place(scene) for scene in (some, beginning(in_detail_order(room), count)))
    np.testing.assert_allclose(widths[:, 0], before[:, 0])
    areas = (widths[:, 1:] / before[:, 1:]).prod(axis=1) * count
    np.testing.assert_allclose(areas, len(room.alive), rtol=1e-5)  # float32 logarithms


@pytest.mark.parametrize("width", [64, 100, 1000])
def test_no_width_of_rows_resonates(width):
    """Of a quarter of rows of any width, no column has more than twice, or less than half, of its share."""
    count = 64 * width
    slots = Gaussians(*(jnp.arange(count * size, dtype=jnp.float32).reshape(count, size) for size in (3, 3, 4)),
                      jnp.zeros(count), jnp.zeros((count, 1, 3)), jnp.ones(count, bool))  # fmt: skip
    first = np.asarray(in_detail_order(slots).means[: count // 4, 0]).astype(int) // 3
    columns = np.bincount(first % width, minlength=width)
    assert columns.min() >= 64 / 4 / 2 and columns.max() <= 64 / 4 * 2
