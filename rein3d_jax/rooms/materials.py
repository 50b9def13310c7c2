"""Materials as ranges: what may be drawn for a painted wall, planks, bricks, cloth, a picture.

A recipe gives (low, high) for each number of a texture; lengths are drawn log-uniformly, the rest uniformly. Colours
are drawn as hue, saturation and value of a display colour, then made linear."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.colour import linear_from_srgb
from rein3d_jax.rooms.model import Textures

_NO_CELLS = 1000.0  # metres: one cell covers everything
_DEFAULT = {
    "hue": (0, 1),
    "saturation": (0, 0.1),
    "value": (0.5, 0.9),
    "spread": (0.03, 0.1),  # of the value, from the ramp's middle to its ends
    "hue_spread": (0, 0.02),  # of the hue, likewise
    "cell_u": (_NO_CELLS, _NO_CELLS),
    "aspect": (1, 1),  # of a cell: width over height
    "shift": (0, 0),
    "joint": (0, 0),
    "joint_shade": (0.4, 0.8),
    "variation": (0, 0),
    "grain_u": (0.1, 0.6),
    "grain_aspect": (1, 1),
    "detail": (0.5, 0.8),
    "contrast": (0.5, 1),
    "glow": (0, 0),
}
_LENGTHS = ("cell_u", "aspect", "joint", "grain_u", "grain_aspect")
_SMALLEST = 1e-4  # metres: stands for 0 where a logarithm is taken

_WOOD = {"hue": (0.04, 0.11), "saturation": (0.25, 0.65), "spread": (0.1, 0.35), "grain_u": (0.3, 1.2)}
_WOOD |= {"grain_aspect": (8, 25), "contrast": (0.7, 1.3), "value": (0.25, 0.85)}
_PLANKS = _WOOD | {"cell_u": (0.5, 2.0), "aspect": (5, 12), "shift": (0.3, 0.45), "variation": (0.05, 0.25)}
_PLANKS |= {"joint": (0.002, 0.006)}
_TILES = {"cell_u": (0.15, 0.7), "joint": (0.004, 0.02), "joint_shade": (0.35, 1.1), "variation": (0, 0.15)}
_TILES |= {"spread": (0.02, 0.2), "saturation": (0, 0.25), "value": (0.45, 0.95), "grain_u": (0.08, 0.5)}
_CLOTH = {"saturation": (0.03, 0.45), "value": (0.2, 0.85), "grain_u": (0.01, 0.08), "spread": (0.08, 0.3)}

_RECIPES = {
    "paint_white": {"hue": (0.03, 0.2), "saturation": (0, 0.13), "value": (0.7, 0.95), "spread": (0.01, 0.06)},
    "paint_tint": {"saturation": (0.08, 0.3), "value": (0.55, 0.85), "spread": (0.01, 0.06)},
    "paint_bold": {"saturation": (0.25, 0.6), "value": (0.35, 0.8), "spread": (0.01, 0.06)},
    "plaster": {"saturation": (0, 0.3), "hue": (0.02, 0.15), "grain_u": (0.02, 0.15), "spread": (0.1, 0.35)},
    "wallpaper": {"saturation": (0, 0.4), "cell_u": (0.06, 0.3), "aspect": (0.05, 1), "variation": (0.03, 0.15)},
    "brick": _TILES
    | {"hue": (0.01, 0.1), "saturation": (0.1, 0.6), "value": (0.3, 0.85), "cell_u": (0.2, 0.5), "aspect": (1.5, 3.5)}
    | {"shift": (0.5, 0.5), "variation": (0.05, 0.25), "spread": (0.1, 0.35), "grain_u": (0.05, 0.2)},
    "pebbles": {"saturation": (0, 0.25), "hue": (0.02, 0.12), "value": (0.35, 0.75), "grain_u": (0.03, 0.1)}
    | {"spread": (0.3, 0.6), "contrast": (1, 2), "detail": (0.4, 0.7)},
    "wall_tile": _TILES | {"aspect": (1, 2), "shift": (0, 0.5), "cell_u": (0.1, 0.4)},
    "planks": _PLANKS,
    "parquet": _PLANKS | {"cell_u": (0.2, 0.5), "aspect": (2, 6), "variation": (0.1, 0.3), "shift": (0.5, 0.5)},
    "floor_tile": _TILES,
    "marble": _TILES
    | {
        "cell_u": (0.6, 2.5),
        "spread": (0.05, 0.35),
        "value": (0.6, 0.95),
        "joint": (0.01, 0.04),
        "saturation": (0, 0.12),
    },
    "terracotta": _TILES
    | {"hue": (0.01, 0.08), "saturation": (0.4, 0.75), "value": (0.4, 0.75), "cell_u": (0.25, 2.0)},
    "slate": _TILES | {"aspect": (0.7, 1.8), "shift": (0.2, 0.5), "value": (0.25, 0.7), "variation": (0.1, 0.25)},
    "concrete": {"spread": (0.05, 0.25), "value": (0.4, 0.8), "grain_u": (0.2, 1.5), "contrast": (0.8, 1.5)},
    "carpet": _CLOTH | {"contrast": (0.8, 1.5)},
    "ceiling": {"hue": (0.03, 0.2), "saturation": (0, 0.08), "value": (0.75, 0.95), "spread": (0, 0.02)},
    "wood": _WOOD,
    "lacquer": {"saturation": (0, 0.25), "value": (0.55, 0.95), "spread": (0, 0.03)},
    "lacquer_bold": {"saturation": (0.4, 0.85), "value": (0.3, 0.8), "spread": (0, 0.05)},
    "black": {"value": (0.04, 0.2), "spread": (0, 0.1)},
    "cloth": _CLOTH,
    "cloth_bold": _CLOTH | {"saturation": (0.4, 0.8), "value": (0.3, 0.75)},
    "stripes": _CLOTH | {"cell_u": (0.05, 0.25), "aspect": (0.02, 0.05), "variation": (0.15, 0.4)},
    "leather": {"hue": (0.02, 0.1), "saturation": (0.1, 0.6), "value": (0.1, 0.5), "grain_u": (0.03, 0.1)},
    "metal": {"value": (0.35, 0.75), "saturation": (0, 0.06)},
    "leaf": {"hue": (0.19, 0.36), "saturation": (0.4, 0.85), "value": (0.15, 0.55), "spread": (0.4, 0.8)}
    | {"grain_u": (0.04, 0.12), "contrast": (1.2, 2.5), "hue_spread": (0.01, 0.05)},
    "ceramic": {"value": (0.82, 0.97), "saturation": (0, 0.05), "spread": (0, 0.02)},
    "screen": {"value": (0.02, 0.08), "spread": (0, 0.3)},
    "mirror": {"value": (0.6, 0.85), "saturation": (0, 0.08), "hue": (0.5, 0.6), "grain_u": (0.5, 1.5)},
    "picture": {"saturation": (0.1, 0.7), "value": (0.3, 0.8), "spread": (0.3, 0.8), "hue_spread": (0.05, 0.5)}
    | {"grain_u": (0.1, 0.5), "grain_aspect": (0.5, 2.0), "contrast": (1.5, 4), "detail": (0.4, 0.9)},
    "books": {"saturation": (0.2, 0.7), "value": (0.3, 0.7), "spread": (0.4, 0.8), "hue_spread": (0.1, 0.5)}
    | {"cell_u": (0.025, 0.06), "aspect": (0.03, 0.06), "variation": (0.2, 0.5), "grain_u": (0.5, 1)}
    | {"contrast": (2, 3)},
    "rug": _CLOTH
    | {"cell_u": (0.1, 0.8), "aspect": (0.5, 2), "variation": (0.1, 0.4), "hue_spread": (0, 0.3), "contrast": (1, 3)}
    | {"grain_u": (0.1, 0.6), "shift": (0, 0.5)},
    "lampshade": {"hue": (0.07, 0.14), "saturation": (0.03, 0.2), "value": (0.9, 0.97), "glow": (0.9, 3)}
    | {"spread": (0, 0.03)},
}

# What a part or a surface may be made of, with weights.
GROUPS = {
    "wall": {"paint_white": 5, "paint_tint": 5, "paint_bold": 2.5, "plaster": 1, "wallpaper": 1},
    "accent": {
        "paint_tint": 1, "paint_bold": 2.5, "plaster": 1.5, "wallpaper": 1, "brick": 3, "pebbles": 1.5, "wood": 0.7,
    },
    "wet_wall": {"wall_tile": 5, "paint_white": 1, "paint_tint": 1.5, "marble": 1},
    "floor": {
        "planks": 4, "parquet": 3, "floor_tile": 1.5, "marble": 1.2, "terracotta": 1, "slate": 1, "concrete": 0.7,
        "carpet": 1.2,
    },
    "wet_floor": {"floor_tile": 4, "marble": 2, "terracotta": 1, "slate": 2, "concrete": 0.5},
    "ceiling": {"ceiling": 8, "paint_tint": 0.7, "wood": 0.5},
    "leaf_of_door": {"wood": 2, "lacquer": 2, "black": 0.2},
    "furniture": {"wood": 5, "lacquer": 3, "lacquer_bold": 0.8, "black": 0.8},
    "front": {"wood": 3, "lacquer": 4, "lacquer_bold": 1, "black": 0.5},
    "soft": {"cloth": 4, "cloth_bold": 1.2, "leather": 1.5, "stripes": 0.6},
    "pillow": {"cloth": 2, "cloth_bold": 3, "stripes": 1.5},
    "linen": {"cloth": 3, "cloth_bold": 1.5, "stripes": 1, "lacquer": 1},
    "support": {"wood": 3, "metal": 2.5, "black": 2, "lacquer": 1},
    "object": {"ceramic": 1, "lacquer_bold": 2, "wood": 1, "metal": 1, "cloth_bold": 1, "black": 0.7},
    **{
        name: {name: 1}
        for name in ("books", "picture", "rug", "leaf", "metal", "ceramic", "screen", "mirror", "lampshade")
    },
    "stone": {"marble": 2, "concrete": 1, "wood": 1.5, "black": 0.7, "slate": 0.5},
}  # fmt: skip
GROUP_INDEX = {name: i for i, name in enumerate(GROUPS)}


def _ranges() -> np.ndarray:
    """(recipes, numbers, 2)."""
    rows = [list((_DEFAULT | recipe).values()) for recipe in _RECIPES.values()]
    return np.array(rows, np.float32)


def _weights() -> np.ndarray:
    """(groups, recipes)."""
    return np.array([[group.get(name, 0) for name in _RECIPES] for group in GROUPS.values()], np.float32)


def draw_textures(key: jax.Array, groups: jax.Array) -> Textures:
    """One texture for each index (m,) into GROUPS."""
    which, amounts, signs = jax.random.split(key, 3)
    recipe = jax.random.categorical(which, jnp.log(_weights())[groups], axis=-1)
    low, high = jnp.moveaxis(jnp.asarray(_ranges())[recipe], -1, 0)
    share = jax.random.uniform(amounts, low.shape)
    length = np.array([name in _LENGTHS for name in _DEFAULT])
    low, high = (jnp.where(length, jnp.log(jnp.maximum(x, _SMALLEST)), x) for x in (low, high))
    drawn = low + (high - low) * share
    number = dict(zip(_DEFAULT, jnp.moveaxis(jnp.where(length, jnp.exp(drawn), drawn), -1, 0), strict=True))
    sign = jnp.where(jax.random.bernoulli(signs, 0.5, groups.shape), 1.0, -1.0)
    return _texture(number, sign)


def _texture(number: dict, hue_sign: jax.Array) -> Textures:
    steps = jnp.array([-1.0, 0.0, 1.0])
    hue = number["hue"][:, None] + (hue_sign * number["hue_spread"])[:, None] * steps
    value = number["value"][:, None] * (1 + number["spread"][:, None] * steps)
    ramp = linear_from_hsv(hue, number["saturation"][:, None], jnp.clip(value, 0.01, 0.97))
    return Textures(
        ramp=ramp,
        cell=jnp.stack([number["cell_u"], number["cell_u"] / number["aspect"]], axis=-1),
        grain=jnp.stack([number["grain_u"], number["grain_u"] / number["grain_aspect"]], axis=-1),
        **{name: number[name] for name in ("shift", "joint", "joint_shade", "variation", "detail", "contrast", "glow")},
    )


def linear_from_hsv(hue: jax.Array, saturation: jax.Array, value: jax.Array) -> jax.Array:
    """Linear colour (..., 3) of hue (a share of the circle), saturation and value of an sRGB colour."""
    third = jnp.array([0.0, 2 / 3, 1 / 3])
    wheel = jnp.clip(jnp.abs(jnp.mod(hue[..., None] + third, 1.0) * 6 - 3) - 1, 0, 1)
    srgb = value[..., None] * (1 - saturation[..., None] * (1 - wheel))
    return linear_from_srgb(srgb)
