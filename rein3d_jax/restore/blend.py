"""The blend of a redrawn clip with what was rendered: observed pixels return, and the guesses beside them take their
colours. Without it, colours drift from pass to pass of a restorer that redraws whole frames.

    out = w rendered + (1 - w) (gain restored + shift),     w = 0 up to alpha `observed`, 1 from TRUSTED

Gain and shift, one of each for a channel and a whole clip (more would flicker), are what brings the restored pixels
nearest to the rendered ones where both are known; pixels count by w and by the area that they cover on the sphere.
"""

import jax
import jax.numpy as jnp

from rein3d_jax.geometry.sphere import latitudes

TRUSTED = 0.9  # alpha from which a pixel returns to the bit
DAMPING = 3.0  # pixels' worth of belief that the colours need no change, for clips of which little was observed


def blend(restored: jax.Array, rendered: jax.Array, alpha: jax.Array, *, observed: float) -> jax.Array:
    """sRGB (t, h, w, 3) in [0, 1]: `restored` by a restorer that redraws all, colours matched to the `rendered` clip's,
    whose pixels return where alpha (t, h, w) says that they were observed."""
    matched = jnp.clip(match_colours(restored, rendered, observed_share(alpha, observed)), 0.0, 1.0)
    return blend_unmatched(matched, rendered, alpha, observed=observed)


def blend_unmatched(restored: jax.Array, rendered: jax.Array, alpha: jax.Array, *, observed: float) -> jax.Array:
    """`blend` without matching colours: for a restorer that redraws holes alone."""
    share = observed_share(alpha, observed)
    mixed = restored + share[..., None] * (rendered - restored)
    return jnp.where(share[..., None] == 1, rendered, mixed)  # 1 - w and w do not sum to 1 to the bit


def observed_share(alpha: jax.Array, observed: float) -> jax.Array:
    """w in [0, 1]: how much of a pixel stays as it was rendered; a step where `observed` is TRUSTED or more."""
    if observed >= TRUSTED:
        return (alpha >= observed).astype(alpha.dtype)
    return jnp.where(alpha >= TRUSTED, 1.0, jnp.clip((alpha - observed) / (TRUSTED - observed), 0.0, 1.0))


def match_colours(restored: jax.Array, rendered: jax.Array, share: jax.Array) -> jax.Array:
    """`restored` (t, h, w, 3) times a gain plus a shift for each channel: ridge regression onto `rendered`, weighed by
    `share` (t, h, w), with gain 1 and shift 0 where there is nothing to learn from."""
    weight = share * jnp.cos(latitudes(share.shape[1]))[:, None]
    total = weight.sum()
    means = [_over_clip(weight, x) / jnp.maximum(total, 1e-6) for x in (restored, rendered)]
    varied, wanted = restored - means[0], rendered - means[1]
    gain = (_over_clip(weight, varied * wanted) + DAMPING) / (_over_clip(weight, varied**2) + DAMPING)
    return means[0] + gain * varied + (means[1] - means[0]) * total / (total + DAMPING)


def _over_clip(weight, x):
    return jnp.einsum("thw,thwc->c", weight, x)
