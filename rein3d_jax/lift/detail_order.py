"""Level of detail by order: every beginning of a scene in this order is the whole scene, with less detail.

A lifted scene has its splats row by row, neighbours together. Ordered by the fractions of their numbers' multiples of
the golden ratio, every beginning is spread evenly over all of them: of any share, the gaps between its numbers are of
three sizes at most (the three-distance theorem, Sos 1957), and no width of rows resonates with it, as a power of two
does with numbers by their reversed bits. Orders that put large, opaque or much seen splats first leave holes where the
rest is missing.
"""

import math

import jax.numpy as jnp
import numpy as np

from rein3d_jax.scene import Gaussians

_GOLDEN = (math.sqrt(5) - 1) / 2


def in_detail_order(gaussians: Gaussians) -> Gaussians:
    """The alive slots in detail order."""
    return _slots(gaussians, _detail_order(gaussians))


def lighter_scene(gaussians: Gaussians, count: int) -> Gaussians:
    """The first `count`, at least 1, of the alive slots in detail order, grown along their two longer axes so that they
    cover as much as all did, in their own order, which packs well; `gaussians` itself where it has no more than
    that."""
    order = _detail_order(gaussians)
    if len(order) <= count:
        return gaussians
    few = _slots(gaussians, np.sort(order[:count]))
    longer = jnp.arange(3) != jnp.argmin(few.log_scales, axis=1, keepdims=True)
    return few.replace(log_scales=few.log_scales + jnp.where(longer, 0.5 * math.log(len(order) / count), 0.0))


def _slots(gaussians: Gaussians, slots: np.ndarray) -> Gaussians:
    fields = (gaussians.means, gaussians.log_scales, gaussians.quats, gaussians.opacity_logits, gaussians.sh)
    return Gaussians(*(jnp.asarray(np.asarray(field)[slots]) for field in fields), jnp.ones(len(slots), bool))


def _detail_order(gaussians: Gaussians) -> np.ndarray:
    """The alive slots' numbers."""
    alive = np.flatnonzero(np.asarray(gaussians.alive))
    return alive[np.argsort(np.arange(len(alive)) * _GOLDEN % 1)]
