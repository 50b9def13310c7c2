"""Real spherical harmonics in the order and sign of 3DGS files, degrees 0 to 3."""

import jax
import jax.numpy as jnp

C0 = 0.28209479177387814
C1 = 0.4886025119029199
C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
C3 = (
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
)


def sh_from_rgb(rgb: jax.Array) -> jax.Array:
    """Colour (..., 3) -> its degree-0 coefficient (..., 3)."""
    return (rgb - 0.5) / C0


def basis(directions: jax.Array, count: int) -> jax.Array:
    """Unit directions (..., 3) -> (..., count) basis values; count is 1, 4, 9 or 16."""
    assert count in (1, 4, 9, 16), count
    x, y, z = jnp.moveaxis(directions, -1, 0)
    terms = [jnp.full_like(x, C0)]
    if count > 1:
        terms += [-C1 * y, C1 * z, -C1 * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        terms += [C2[0] * x * y, C2[1] * y * z, C2[2] * (2 * zz - xx - yy), C2[3] * x * z, C2[4] * (xx - yy)]
    if count > 9:
        terms += [
            C3[0] * y * (3 * xx - yy),
            C3[1] * x * y * z,
            C3[2] * y * (4 * zz - xx - yy),
            C3[3] * z * (2 * zz - 3 * xx - 3 * yy),
            C3[4] * x * (4 * zz - xx - yy),
            C3[5] * z * (xx - yy),
            C3[6] * x * (xx - 3 * yy),
        ]
    return jnp.stack(terms, axis=-1)


def rgb_from_sh(sh: jax.Array, directions: jax.Array) -> jax.Array:
    """Coefficients (..., k, 3) seen along unit directions (..., 3) -> colour (..., 3), clipped below at 0."""
    return jnp.maximum(jnp.sum(sh * basis(directions, sh.shape[-2])[..., None], axis=-2) + 0.5, 0.0)
