"""Procedural textures under a pixel's footprint: what is finer than the footprint has been averaged away."""

import jax
import jax.numpy as jnp

from rein3d_jax.rooms.tracing.vectors import Vector, scale

_OCTAVES = 4
# Value noise holds up to one wave a cell; it fades while the footprint grows over these shares of a cell, so that
# nothing is left that two samples a wave cannot show.
_FADE_FROM, _FADE_TO = 0.3, 0.8
_THIN = 1e-4  # metres: a footprint no texture is finer than


def _hashed(x: jax.Array, y: jax.Array, seed: jax.Array) -> jax.Array:
    """Noise in [0, 1), the same for the same integers: x, y whole numbers as float32, seed uint32."""
    h = x.astype(jnp.int32).astype(jnp.uint32) * jnp.uint32(0x8DA6B343)
    h = (h ^ (y.astype(jnp.int32).astype(jnp.uint32) * jnp.uint32(0xD8163841))) + seed
    h = (h ^ (h >> 15)) * jnp.uint32(0x2C1B3C6D)
    h = (h ^ (h >> 12)) * jnp.uint32(0x297A2D39)
    return (h >> 8).astype(jnp.int32).astype(jnp.float32) * (1 / 2**24)


def _value_noise(x: jax.Array, y: jax.Array, seed: jax.Array) -> jax.Array:
    """Random values in [-0.5, 0.5) at whole x, y, joined smoothly."""
    x0, y0 = jnp.floor(x), jnp.floor(y)
    x, y = x - x0, y - y0
    x, y = x * x * (3 - 2 * x), y * y * (3 - 2 * y)
    low = _hashed(x0, y0, seed) * (1 - x) + _hashed(x0 + 1, y0, seed) * x
    high = _hashed(x0, y0 + 1, seed) * (1 - x) + _hashed(x0 + 1, y0 + 1, seed) * x
    return low * (1 - y) + high * y - 0.5


def fractal_noise(x: jax.Array, y: jax.Array, footprint: jax.Array, detail: jax.Array, seed: jax.Array) -> jax.Array:
    """Octaves of value noise, about [-1, 1]. x, y and footprint in cells of the coarsest; an octave fades as the
    footprint nears its cell."""
    total, amplitude, power = 0.0, 1.0, 0.0
    for octave in range(_OCTAVES):
        finer = 2.0**octave
        fade = jnp.clip((_FADE_TO - footprint * finer) / (_FADE_TO - _FADE_FROM), 0, 1)
        total += amplitude * fade * _value_noise(x * finer, y * finer, seed + jnp.uint32(octave))
        power += amplitude * amplitude
        amplitude = amplitude * detail
    return 2 * total * jax.lax.rsqrt(power)


def joints(x: jax.Array, period: jax.Array, width: jax.Array, footprint: jax.Array) -> jax.Array:
    """Share of [x - f/2, x + f/2] covered by joints of `width` centred on the multiples of `period`: exact."""
    footprint = jnp.maximum(footprint, _THIN)

    def integral(end):
        cells = end / period
        whole = jnp.floor(cells)
        return whole * width + jnp.minimum((cells - whole) * period, width)

    start = x + 0.5 * width - 0.5 * footprint
    return jnp.clip((integral(start + footprint) - integral(start)) / footprint, 0, 1)


def _ramp_colour(ramp: tuple[Vector, Vector, Vector], position: jax.Array) -> Vector:
    """Colour at `position` in [0, 1] of a ramp through three colours, linearly interpolated."""
    low, high = jnp.clip(2 * position, 0, 1), jnp.clip(2 * position - 1, 0, 1)
    return tuple(a + (b - a) * low + (c - b) * high for a, b, c in zip(*ramp, strict=True))


def reflectance(texture: dict, u: jax.Array, v: jax.Array, du: jax.Array, dv: jax.Array, seed: jax.Array) -> Vector:
    """Linear colour at surface coordinates u, v (metres) under a footprint du, dv (metres).

    `texture` holds a row of model.Textures for every pixel, each number an array: see shade.gather_texture."""
    cell_u, cell_v = texture["cell"]
    # The origin lies in the middle of a cell: what has no cells is one cell, hundreds of metres wide.
    upwards = v + 0.5 * cell_v
    row = jnp.floor(upwards / cell_v)
    moved = u + (texture["shift"] * row + 0.5) * cell_u
    tone = _hashed(jnp.floor(moved / cell_u), row, seed)
    apart = jnp.clip(1.5 - jnp.maximum(du / cell_u, dv / cell_v), 0, 1)
    # Each plank or tile is cut from another place.
    grain_u, grain_v = texture["grain"]
    x, y = u / grain_u + 61.0 * tone, v / grain_v + 37.0 * tone
    noise = fractal_noise(x, y, jnp.maximum(du / grain_u, dv / grain_v), texture["detail"], seed)
    colour = _ramp_colour(texture["ramp"], 0.5 + 0.5 * texture["contrast"] * noise)
    across = 1 - joints(moved, cell_u, texture["joint"], du)
    joint = 1 - across * (1 - joints(upwards, cell_v, texture["joint"], dv))
    cells = 1 + texture["variation"] * apart * (2 * tone - 1)
    return scale(colour, cells * (1 + joint * (texture["joint_shade"] - 1)))
