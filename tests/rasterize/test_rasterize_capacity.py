"""Laws of the buffers: what does not fit is counted, and `render` makes room for it."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.errors import InputError
from rein3d_jax.rasterize import Buffers, RasterizeConfig, allocate, bucket, rasterize, render


def test_buffers_that_just_fit_give_the_roomy_picture(scene_of, camera_of, config, roomy) -> None:
    camera = camera_of(PINHOLE)
    frame = rasterize(scene_of(), camera, config=config, buffers=roomy)
    tight = rasterize(scene_of(), camera, config=config, buffers=Buffers(*map(int, frame.needed)))
    assert int(frame.overflow) == int(tight.overflow) == 0
    np.testing.assert_allclose(tight.rgb, frame.rgb, atol=5e-6)  # the same sums, vectorised otherwise


@pytest.mark.parametrize("buffer", Buffers._fields)
def test_one_too_few_is_counted_and_render_makes_room(buffer, scene_of, camera_of, config, roomy) -> None:
    camera = camera_of(PINHOLE)
    frame = rasterize(scene_of(), camera, config=config, buffers=roomy)
    just = Buffers(*map(int, frame.needed))
    short = just._replace(**{buffer: getattr(just, buffer) - 1})
    assert just.hold(frame.needed) and not short.hold(frame.needed)
    assert int(rasterize(scene_of(), camera, config=config, buffers=short).overflow) > 0
    again, grown = render(scene_of(), camera, config=config, buffers=short)
    assert int(again.overflow) == 0 and grown.hold(short)
    np.testing.assert_allclose(again.rgb, frame.rgb, atol=5e-6)  # as above
    np.testing.assert_allclose(again.distance, frame.distance, atol=3e-5)  # metres up to 4, divided by alpha


def test_allocate_measures_enough_for_its_cameras(scene_of, camera_of, config) -> None:
    camera = camera_of(PINHOLE)
    buffers = allocate(scene_of(), [camera], config=config)
    frame, same = render(scene_of(), camera, config=config, buffers=buffers)
    assert int(frame.overflow) == 0 and same == buffers
    assert render(scene_of(), camera, config=config)[1] == buffers


def test_an_empty_buffer_is_refused(scene_of, camera_of, config, roomy) -> None:
    with pytest.raises(InputError, match=r"Buffers\(visible=64, rows=192, pairs=0, chunks=160\) .* call allocate"):
        rasterize(scene_of(), camera_of(PINHOLE), config=config, buffers=roomy._replace(pairs=0))


def test_a_tile_that_does_not_divide_the_width_is_refused(scene_of, camera_of, roomy) -> None:
    """Tiles wrap around a panorama's seam; a partial one would lie on both sides of it."""
    config = RasterizeConfig(tile=12)
    with pytest.raises(InputError, match=r"rasterize.tile 12 .* width 32"):
        rasterize(scene_of(), camera_of(EQUIRECTANGULAR), config=config, buffers=roomy)


@settings(deadline=None)
@given(st.integers(64, 2**30), st.integers(0, 1000))
def test_a_bucket_holds_its_count_wastes_a_quarter_at_most_and_never_shrinks(count: int, more: int) -> None:
    assert count <= bucket(count) <= 1.25 * count and bucket(count) <= bucket(count + more)
    assert bucket(bucket(count)) == bucket(count)


@given(st.lists(st.integers(0, 2**24), min_size=8, max_size=8))
def test_enlarged_buffers_hold_what_is_needed_and_never_shrink(sizes: list[int]) -> None:
    before, needed = Buffers(*sizes[:4]), sizes[4:]
    after = before.enlarged(needed)
    assert after.hold(needed) and after.hold(before) and after.enlarged(needed) == after
    assert before.enlarged(needed, slack=1.25).hold(int(1.25 * x) for x in needed)
