"""Laws of the guided filter on the sphere."""

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.depth.guided import guided_by

H, W = 32, 64


def halves(rows, columns, edge):
    """A picture whose right part, from column `edge`, has another colour."""
    right = jnp.arange(columns) >= edge
    colour = jnp.where(right[:, None], jnp.array([0.8, 0.3, 0.2]), jnp.array([0.2, 0.5, 0.6]))
    return jnp.broadcast_to(colour, (rows, columns, 3))


def test_a_constant_stays():
    picture = jax.random.uniform(jax.random.key(0), (H, W, 3))
    np.testing.assert_allclose(guided_by(picture, jnp.full((H, W), 0.3)), 0.3, atol=1e-4)  # float32 solves


def test_a_map_that_is_linear_in_the_picture_stays():
    picture = jax.random.uniform(jax.random.key(0), (H, W, 3))
    image = picture @ jnp.array([0.5, -0.2, 0.1]) + 0.4
    # shrunk by noise^2 over the variance, 1e-4 / 0.08
    np.testing.assert_allclose(guided_by(picture, image), image, atol=3e-3)


def test_a_blurred_step_goes_to_the_pictures_edge():
    edge = W // 2
    blurred = jax.nn.sigmoid((jnp.arange(W) - edge - 1.5) / 2.0) * jnp.ones((H, 1))  # misplaced by 1.5 + 0.5 pixels
    assert (blurred[H // 2] > 0.5).sum() != (jnp.arange(W) >= edge).sum()
    found = guided_by(halves(H, W, edge), blurred)[H // 2] > 0.5
    middle = slice(W // 4, 3 * W // 4)  # the picture has another edge at the seam
    np.testing.assert_array_equal(found[middle], (jnp.arange(W) >= edge)[middle])


def test_it_commutes_with_a_yaw():
    picture = jax.random.uniform(jax.random.key(1), (H, W, 3))
    image = jax.random.uniform(jax.random.key(2), (H, W))
    turned = guided_by(jnp.roll(picture, 9, axis=1), jnp.roll(image, 9, axis=1))
    np.testing.assert_allclose(turned, jnp.roll(guided_by(picture, image), 9, axis=1), atol=1e-4)  # float32 solves
