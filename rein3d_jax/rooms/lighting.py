"""Lamps and windows, what the room reflects of them, and how the picture is exposed."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.rooms.furniture.catalogue import PIECE_NAMES
from rein3d_jax.rooms.furniture.furnish import Furniture
from rein3d_jax.rooms.materials import linear_from_hsv
from rein3d_jax.rooms.model import Lights, Openings, Outside, Textures
from rein3d_jax.rooms.plan import Plan

_LIGHTS = 3  # a ceiling lamp, a window (else a second ceiling lamp), a floor lamp (else a second window)
_LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # Rec. 709


def draw_lights(key: jax.Array, plan: Plan, furniture: Furniture, openings: Openings) -> Lights:
    """The three lights. Their strengths matter relative to one another only: exposure evens them out."""
    spot_key, strength_key, colour_key, radius_key = jax.random.split(key, 4)
    floor, ceiling = plan.low[2], plan.high[2]
    spots = plan.low[:2] + (plan.high[:2] - plan.low[:2]) * jax.random.uniform(spot_key, (2, 2), minval=0.2, maxval=0.8)
    hung = _is_any(furniture.piece[0], ("pendant", "ceiling_disc", "spots"))
    first = jnp.where(hung, furniture.place.centre[0], spots[0])
    below = jnp.where(
        furniture.piece[0] == PIECE_NAMES.index("pendant"), ceiling - furniture.size[0, 2] - 0.02, ceiling - 0.2
    )
    at_ceiling = [jnp.append(first, below), jnp.append(spots[1], ceiling - 0.25)]
    panes = [_window(openings, index) for index in (0, 1)]
    is_lamp = _is_any(furniture.piece, ("floor_lamp",))
    lamp = jnp.argmax(is_lamp)
    lamp_top = jnp.append(furniture.place.centre[lamp], floor + furniture.size[lamp, 2] - 0.12)
    use_window = jnp.stack([jnp.asarray(False), panes[0][2], ~is_lamp.any() & panes[1][2]])
    position = jnp.stack([
        at_ceiling[0],
        jnp.where(panes[0][2], panes[0][0], at_ceiling[1]),
        jnp.where(is_lamp.any(), lamp_top, jnp.where(panes[1][2], panes[1][0], at_ceiling[1])),
    ])  # fmt: skip
    axis = jnp.stack([jnp.array([0.0, 0.0, -1.0]), panes[0][1], panes[1][1]])
    strength = jnp.exp(jax.random.uniform(strength_key, (_LIGHTS,), minval=-1.6, maxval=0.9))
    on = jnp.array([1.0, 1.0, 0.5]) * strength * jnp.where(use_window, 2.5, 1.0)
    hue, tint = jax.random.uniform(colour_key, (2, _LIGHTS))
    warm = linear_from_hsv(0.06 + 0.07 * hue, 0.22 * tint, jnp.ones(_LIGHTS))
    cold = linear_from_hsv(0.55 + 0.08 * hue, 0.15 * tint, jnp.ones(_LIGHTS))
    radius = jax.random.uniform(radius_key, (_LIGHTS,), minval=0.1, maxval=0.3)
    return Lights(
        position=position,
        radius=jnp.where(use_window, 0.5, radius),
        power=on[:, None] * jnp.where(use_window[:, None], cold, warm),
        axis=axis,
        spread=jnp.where(use_window, jnp.float32(0.15), 1.0),
    )


def _is_any(piece: jax.Array, names: tuple[str, ...]) -> jax.Array:
    return jnp.isin(piece, jnp.array([PIECE_NAMES.index(name) for name in names]))


def _window(openings: Openings, index: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """(a point just inside window `index`, the direction into the room, whether it is there)."""
    wall = openings.wall[index]
    inward = jnp.where(wall < 2, -1.0, 1.0) * (jnp.arange(3) == wall % 2)
    at = openings.centre[index] + inward * (openings.half[index] + 0.03)
    return at, inward, jnp.abs(openings.centre[index, 0]) < 100


def reflected(plan: Plan, lights: Lights, textures: Textures, boost: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Ambient light (2, 3) from below and from above, and mean radiosity (3,): a closed room of area A and mean
    reflectance rho, lit by the flux P, sends rho P / A / (1 - rho) from every wall; floor and ceiling in their
    colours."""
    x, y, z = plan.high - plan.low
    areas = jnp.stack([x * y, x * y, y * z, x * z, y * z, x * z])
    shell = textures.ramp[:6, 1]
    rho = 0.8 * (areas[:, None] * shell).sum(0) / areas.sum()  # furniture swallows light
    flux = ((jnp.pi * (1 + 3 * lights.spread))[:, None] * lights.power).sum(0)
    direct = flux / areas.sum()
    ambient = boost * rho * direct / (1 - rho)
    tinted = [ambient * (0.35 + 0.65 * shell[face] / rho) for face in (0, 1)]
    return jnp.stack(tinted), rho * (direct + ambient)


def draw_exposure(key: jax.Array, radiosity: jax.Array) -> jax.Array:
    """Display value per linear light: what brings the mean radiosity to 0.07-0.42, dark to bright pictures."""
    target = jnp.exp(jax.random.uniform(key, minval=jnp.log(0.07), maxval=jnp.log(0.42)))
    return -jnp.log1p(-target) / (radiosity * _LUMINANCE).sum()


def draw_outside(key: jax.Array) -> Outside:
    """A day over houses or trees, an overcast one, or dusk."""
    hue, saturation, value, skyline, scale, bright = jax.random.split(key, 6)
    hues = jnp.array([0.58, 0.58, 0.2, 0.2]) + jnp.array([0.05, 0.05, 0.2, 0.15]) * jax.random.uniform(
        hue, (4,), minval=-1
    )
    tints = jnp.array([0.5, 0.15, 0.4, 0.35]) * jax.random.uniform(saturation, (4,))
    values = jnp.array([0.75, 0.9, 0.45, 0.5]) * jax.random.uniform(value, (4,), minval=0.6, maxval=1.1)
    level = jax.random.uniform(skyline, (2,), minval=jnp.array([-0.1, 0.0]), maxval=jnp.array([0.4, 0.25]))
    cells = jax.random.uniform(scale, (2,), minval=jnp.array([5.0, 0.5]), maxval=jnp.array([20.0, 2.0]))
    brightness = jnp.exp(jax.random.uniform(bright, minval=-0.3, maxval=1.6))
    return Outside(linear_from_hsv(hues, tints, jnp.minimum(values, 1)), level, cells, brightness)
