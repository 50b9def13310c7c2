"""Textures: exact at texel centres, repeating, one mean at every size, no aliasing."""

import numpy as np

from rein3d_jax.meshes.texture import sample_texture, texture

RNG = np.random.default_rng(0)
PICTURE = RNG.integers(0, 256, (8, 16, 3)).astype(np.uint8)


def centres(h, w):
    """uv of texel centres (h w, 2), v upwards."""
    u, v = np.meshgrid((np.arange(w) + 0.5) / w, 1 - (np.arange(h) + 0.5) / h)
    return np.stack([u, v], -1).reshape(-1, 2)


def test_texel_centres_are_exact_and_the_picture_repeats():
    uv = centres(8, 16)
    expected = PICTURE.reshape(-1, 3) / 255
    for shift in ((0, 0), (1, 0), (-3, 2)):
        colour = sample_texture(texture(PICTURE), uv + shift, np.zeros(len(uv)))
        np.testing.assert_allclose(colour, expected, atol=1e-12)  # float64
    level = np.full(len(uv), -np.inf)  # a footprint of no size
    np.testing.assert_allclose(sample_texture(texture(PICTURE), uv, level), expected, atol=1e-12)


def test_one_colour_stays_itself_everywhere():
    uv, level = 5 * RNG.standard_normal((200, 2)), RNG.uniform(-3, 12, 200)
    plain = np.full((5, 7, 3), (10, 200, 90), np.uint8)
    found = sample_texture(texture(plain), uv, level)
    np.testing.assert_allclose(found, np.tile(plain[0, 0] / 255, (200, 1)), atol=1e-12)


def test_large_footprints_read_the_mean():
    colour = sample_texture(texture(PICTURE), RNG.random((50, 2)), np.full(50, 20.0))
    # Every halving rounds to bytes once, half a byte at most.
    np.testing.assert_allclose(colour, np.tile(PICTURE.mean((0, 1)) / 255, (50, 1)), atol=4 * 0.5 / 255)


def test_levels_blend_without_a_step():
    uv = np.tile(RNG.random(2), (2, 1))
    for level in (1.0, 2.0):
        below, above = sample_texture(texture(PICTURE), uv, np.array([level - 1e-9, level + 1e-9]))
        np.testing.assert_allclose(below, above, atol=1e-7)  # the slope of a level times 2e-9
