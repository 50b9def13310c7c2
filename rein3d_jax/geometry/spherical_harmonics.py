"""Real spherical harmonics in the order and sign of 3DGS files, degrees 0 to 3."""

import jax
import jax.numpy as jnp

C0 = 0.28209479177387814  # the constant harmonic: colour = 0.5 + C0 * coefficient
_C1 = 0.4886025119029199
_C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
_C3 = (
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
)


def sh_from_rgb(rgb: jax.Array) -> jax.Array:
    """The degree-0 coefficient (..., 3) of a colour (..., 3)."""
    return (rgb - 0.5) / C0


def basis(directions: jax.Array, count: int) -> jax.Array:
    """Basis values (..., count) at unit directions (..., 3); count is 1, 4, 9 or 16."""
    assert count in (1, 4, 9, 16), count
    x, y, z = jnp.moveaxis(directions, -1, 0)
    terms = [jnp.full_like(x, C0)]
    if count > 1:
        terms += [-_C1 * y, _C1 * z, -_C1 * x]
    if count > 4:
        xx, yy, zz = x * x, y * y, z * z
        terms += [_C2[0] * x * y, _C2[1] * y * z, _C2[2] * (2 * zz - xx - yy), _C2[3] * x * z, _C2[4] * (xx - yy)]
    if count > 9:
        terms += [
            _C3[0] * y * (3 * xx - yy),
            _C3[1] * x * y * z,
            _C3[2] * y * (4 * zz - xx - yy),
            _C3[3] * z * (2 * zz - 3 * xx - 3 * yy),
            _C3[4] * x * (4 * zz - xx - yy),
            _C3[5] * z * (xx - yy),
            _C3[6] * x * (xx - 3 * yy),
        ]
    return jnp.stack(terms, axis=-1)


def rgb_from_sh(sh: jax.Array, directions: jax.Array) -> jax.Array:
    """The colour (..., 3) of coefficients (..., k, 3) along unit directions (..., 3), clipped below at 0."""
    return jnp.maximum(jnp.sum(sh * basis(directions, sh.shape[-2])[..., None], axis=-2) + 0.5, 0.0)
