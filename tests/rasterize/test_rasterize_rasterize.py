"""Laws of the whole rasterizer: it equals the dense oracle, and it turns, repeats, batches and exports."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.rotations import matrix_from_quats, quats_from_matrix, yaw_quat
from rein3d_jax.rasterize import rasterize
from rein3d_jax.scene import Gaussians

MODELS = pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])


@MODELS
@pytest.mark.parametrize("antialias", [True, False])
def test_value_and_gradient_equal_the_oracle(model, antialias, scene_of, camera_of, config, fast, slow) -> None:
    """The pinhole image is no whole number of tiles wide; the panorama's splats lie over poles and seam."""
    config = dataclasses.replace(config, antialias=antialias)
    image, gradient = fast(scene_of(), camera_of(model), config=config)
    oracle, expected = slow(scene_of(), camera_of(model), config=config)
    for actual, value in zip(image, oracle, strict=True):
        # float32: log alpha is a polynomial about the tile's anchor here, a sum of terms up to 50 that rounds to 3e-6,
        # and distances reach 4 m; a lost splat would show at least 4e-3.
        np.testing.assert_allclose(actual, value, atol=2e-5)
    for name, value in expected.items():
        scale = float(jnp.abs(value).max())
        assert scale > 0.1, name  # the loss does depend on it
        # The same, summed over n = 512 pixels with random signs: sqrt(n) eps of the sum of magnitudes, which is about
        # sqrt(n) times the leaf's largest; a splat left out would show all of it.
        np.testing.assert_allclose(gradient[name], value, atol=1e-4 * scale, err_msg=name)


@pytest.mark.parametrize("columns", [5, 16])  # no multiple of a tile, and half a turn
def test_a_yawed_scene_gives_a_rolled_panorama(columns, scene_of, camera_of, config, fast) -> None:
    scene = scene_of()
    scene = scene.replace(sh=scene.sh.at[:, 1:].set(0.0))  # directional colour would have to turn along
    yaw = matrix_from_quats(yaw_quat(columns / 32 * 2 * np.pi))
    means = jnp.matmul(scene.means, yaw.T, precision="highest")
    axes = jnp.matmul(yaw, matrix_from_quats(scene.quats), precision="highest")
    turned = scene.replace(means=means, quats=quats_from_matrix(axes))
    camera = camera_of(EQUIRECTANGULAR, upright(jnp.zeros(3)))
    image, _ = fast(scene, camera, config=config)
    rolled, _ = fast(turned, camera, config=config)
    for before, after in zip(image, rolled, strict=True):
        # Columns turn right, the scene turns left. The rotation rounds directions to 1e-7, of splats as thin as
        # a hundredth of a radian.
        np.testing.assert_allclose(after, jnp.roll(before, -columns, axis=1), atol=1e-4)


@MODELS
def test_same_inputs_same_bytes(model, scene_of, camera_of, config, fast) -> None:
    once, again = (jax.tree.leaves(fast(scene_of(), camera_of(model), config=config)) for _ in range(2))
    for a, b in zip(once, again, strict=True):
        assert np.asarray(a).tobytes() == np.asarray(b).tobytes()


@MODELS
def test_an_empty_scene_is_black(model, scene_of, camera_of, config, fast) -> None:
    scene = scene_of()
    dead = scene.replace(alive=jnp.zeros_like(scene.alive))
    for leaf in jax.tree.leaves(fast(dead, camera_of(model), config=config)):
        assert not np.any(leaf)


@MODELS
def test_what_shines_through_a_wall_from_far_behind_hardly_moves_it(model, camera_of, config, roomy) -> None:
    """A hundredth of what lies 100 m away would make 2 m 3; the harmonic mean makes it 2.02."""
    camera = camera_of(model, upright(jnp.zeros(3)))
    means, opacity = jnp.array([[2.0, 0, 0], [100.0, 0, 0]]), jnp.log(jnp.array([99.0, 99.0]))
    sizes = jnp.log(jnp.array([[0.5] * 3, [25.0] * 3]))
    quats, alive = jnp.tile(jnp.array([1.0, 0, 0, 0]), (2, 1)), jnp.ones(2, bool)
    scene = Gaussians(means, sizes, quats, opacity, jnp.zeros((2, 1, 3)), alive)
    frame = rasterize(scene, camera, config=config, buffers=roomy)
    middle = frame.distance[camera.height // 2, camera.width // 2]
    np.testing.assert_allclose(middle, 2.0, rtol=0.05)  # the splat's own curve from its middle on


def test_one_vmap_over_cameras_equals_calls_one_by_one(scene_of, camera_of, config, roomy) -> None:
    poses = jnp.stack([upright(jnp.zeros(3), 0.3), upright(jnp.array([0.3, 0.0, 0.1]), 2.0, -0.4)])

    def view(pose):
        return rasterize(scene_of(), camera_of(PINHOLE, pose), config=config, buffers=roomy)

    together = jax.vmap(view)(poses)
    for i, pose in enumerate(poses):
        for a, b in zip(jax.tree.leaves(together), jax.tree.leaves(view(pose)), strict=True):
            np.testing.assert_allclose(a[i], b, atol=3e-5)  # the same float32 sums, vectorised otherwise; metres to 4


@MODELS
def test_value_and_gradient_lower_for_every_platform(model, scene_of, camera_of, config, fast) -> None:
    platforms = ("cpu", "cuda", "tpu")
    both = jax.jit(lambda scene, camera: fast(scene, camera, config=config))
    exported = jax.export.export(both, platforms=platforms)(scene_of(), camera_of(model))
    assert exported.platforms == platforms
