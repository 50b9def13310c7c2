"""The second look: the lines in which walls meet floor and ceiling, moved to where the picture has them.

The horizon branch reads a room from bands of latitude, and a band is some 6 degrees: of a wall 4 m away, a quarter of
its distance. Here each column looks again at the picture and at its finest features a few rows above and below both
lines, as the room just drawn has them, and says by what angle each line is off. Angles are what is seen there, and
need not be learned anew for every distance."""

import flax.linen as nn
import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.network.config import DepthNetworkConfig
from rein3d_jax.depth.network.horizon import HorizonLayer, to_columns

_REACH = 8  # rows of the picture above and below a line
_LOWEST, _STEEPEST = 0.02, np.pi / 2 - 0.05  # radians from the horizon at which a line can be
_STEP = 0.1  # radians for one unit of what the last layer says


class SecondLook(nn.Module):
    """Panoramas (n, h, w, 3), features at strides 2 and 4, columns (n, w / 4, c), inverse walls and ceiling
    (n, w / 4, 2) -> those corrected, (n, w / 4, 2)."""

    config: DepthNetworkConfig

    @nn.compact
    def __call__(self, grids: list[jax.Array], columns: jax.Array, planes: jax.Array) -> jax.Array:
        floor, ceiling = lines_of(planes)
        seen = [strips(grid, line, _REACH) for line in (floor, -ceiling) for grid in grids]
        lines = jax.lax.stop_gradient(jnp.stack([floor, ceiling], axis=-1))
        hidden = nn.Dense(columns.shape[-1])(jnp.concatenate([*seen, lines], axis=-1))
        hidden = HorizonLayer(self.config.heads)(columns + nn.gelu(hidden))
        off = _STEP * nn.Dense(2, kernel_init=nn.initializers.zeros)(nn.LayerNorm()(hidden))
        return planes_of(floor + off[..., 0], ceiling + off[..., 1])


def lines_of(planes: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Angles (...) below and above the horizon, in radians, at which walls meet floor and ceiling, of inverse distances
    of walls and ceiling (..., 2)."""
    walls, ceiling = planes[..., 0], planes[..., 1]
    return jnp.arctan(walls), jnp.arctan2(walls, ceiling)


def planes_of(floor: jax.Array, ceiling: jax.Array) -> jax.Array:
    """The inverse of `lines_of`, for angles kept from the horizon and from the poles."""
    walls = jnp.tan(jnp.clip(floor, _LOWEST, _STEEPEST))
    return jnp.stack([walls, walls / jnp.tan(jnp.clip(ceiling, _LOWEST, _STEEPEST))], axis=-1)


def strips(grid: jax.Array, line: jax.Array, reach: int) -> jax.Array:
    """What a grid (n, h, w, c) shows around a line, angles (n, k) from the horizon, positive ones below, in the k
    columns' own w / k columns of it: (n, k, .), `reach` rows of the picture each way, a picture being 2 k rows high."""
    n, height, width, _ = grid.shape
    count = line.shape[1]
    rows = to_columns(line[..., None], width)[..., 0] / np.pi * height + (height - 1) / 2
    reach = reach * height // (2 * count)
    around = jax.lax.stop_gradient(rows)[:, None] + np.arange(-reach, reach + 1)[:, None]
    low = jnp.clip(jnp.floor(around), 0, height - 2)
    share = jnp.clip(around - low, 0, 1)[..., None]
    upper, lower = (
        jnp.take_along_axis(grid, (low.astype(jnp.int32) + down)[..., None], axis=1) for down in (0, 1)
    )  # fmt: skip
    there = (1 - share) * upper + share * lower
    return jnp.moveaxis(there, 1, 2).reshape(n, count, -1)
