"""Laws of the buffers: what does not fit is counted, and `render` makes room for it."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import RasterizeConfig, allocate, bucket, rasterize, render

BUFFERS = ("visible_capacity", "row_capacity", "pair_capacity", "chunk_capacity")


def fitted(config: RasterizeConfig, needed) -> RasterizeConfig:
    return dataclasses.replace(config, **dict(zip(BUFFERS, map(int, needed), strict=True)))


def test_buffers_that_just_fit_give_the_roomy_picture(scene_of, camera_of, roomy) -> None:
    camera = camera_of(PINHOLE)
    frame = rasterize(scene_of(), camera, config=roomy)
    tight = rasterize(scene_of(), camera, config=fitted(roomy, frame.needed))
    assert int(frame.overflow) == int(tight.overflow) == 0
    np.testing.assert_allclose(tight.rgb, frame.rgb, atol=5e-6)  # the same sums, vectorised otherwise


@pytest.mark.parametrize("buffer", BUFFERS)
def test_one_too_few_is_counted_and_render_makes_room(buffer, scene_of, camera_of, roomy) -> None:
    camera = camera_of(PINHOLE)
    frame = rasterize(scene_of(), camera, config=roomy)
    short = fitted(roomy, frame.needed - jnp.array([buffer == name for name in BUFFERS]))
    assert int(rasterize(scene_of(), camera, config=short).overflow) > 0
    again, grown = render(scene_of(), camera, config=short)
    assert int(again.overflow) == 0 and all(getattr(grown, name) >= getattr(short, name) for name in BUFFERS)
    np.testing.assert_allclose(again.rgb, frame.rgb, atol=5e-6)  # as above
    np.testing.assert_allclose(again.distance, frame.distance, atol=3e-5)  # metres up to 4, divided by alpha


def test_allocate_measures_enough_for_its_cameras(scene_of, camera_of) -> None:
    camera = camera_of(PINHOLE)
    config = allocate(scene_of(), [camera], config=RasterizeConfig(chunk=4))
    frame, same = render(scene_of(), camera, config=config)
    assert int(frame.overflow) == 0 and same == config


def test_unset_buffers_are_refused(scene_of, camera_of) -> None:
    with pytest.raises(InputError, match="call allocate"):
        rasterize(scene_of(), camera_of(PINHOLE), config=RasterizeConfig())


def test_a_tile_that_does_not_divide_the_width_is_refused(scene_of, camera_of, roomy) -> None:
    """Tiles wrap around a panorama's seam; a partial one would lie on both sides of it."""
    config = dataclasses.replace(roomy, tile=12)
    with pytest.raises(InputError, match=r"rasterize.tile 12 .* width 32"):
        rasterize(scene_of(), camera_of(EQUIRECTANGULAR), config=config)


@settings(deadline=None)
@given(st.integers(64, 2**30), st.integers(0, 1000))
def test_a_bucket_holds_its_count_wastes_a_quarter_at_most_and_never_shrinks(count: int, more: int) -> None:
    assert count <= bucket(count) <= 1.25 * count and bucket(count) <= bucket(count + more)
    assert bucket(bucket(count)) == bucket(count)
