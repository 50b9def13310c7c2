"""Whatever the parameters, pictures and gradients are finite."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.conventions import EQUIRECTANGULAR, PINHOLE
from rein3d_jax.rasterize import accumulated_weight, rasterize, render


def hostile(scene, camera, seed: int):
    """Centres at, behind and astride the camera, sizes 1e-8..1e3 m, no rotation, opacity logits +-100, NaN and inf.

    Every third Gaussian stays as it is, to be seen among them."""
    rng = np.random.default_rng(seed)
    count = scene.alive.shape[0]
    reach = 10.0 ** rng.uniform(-6, 1, (count, 1))
    means = np.asarray(camera.world_from_camera[:3, 3]) + reach * rng.normal(size=(count, 3))
    means[0] = camera.world_from_camera[:3, 3]
    means[1] = 1e20
    log_scales = rng.uniform(np.log(1e-8), np.log(1e3), (count, 3))
    quats = rng.normal(size=(count, 4)) * (rng.random((count, 1)) < 0.8)
    logits = rng.choice([-100.0, 100.0, 0.0], count)
    names = ("means", "log_scales", "quats", "opacity_logits", "sh")
    leaves = [means, log_scales, quats, logits, np.array(scene.sh)]
    for name, leaf in zip(names, leaves, strict=True):
        leaf[2::3] = getattr(scene, name)[2::3]
        row = rng.integers(count, size=4)
        leaf[row] = np.array([np.nan, np.inf, -np.inf, np.nan]).reshape(-1, *[1] * (leaf.ndim - 1))
    return scene.replace(**{name: jnp.float32(x) for name, x in zip(names, leaves, strict=True)})


@pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])
def test_outputs_and_gradients_are_finite(model, scene_of, camera_of, config, fast) -> None:
    camera = camera_of(model)
    seen = 0.0
    for seed in range(12):
        image, gradient = fast(hostile(scene_of(), camera, seed), camera, config=config)
        for path, leaf in jax.tree.leaves_with_path((image, gradient)):
            assert np.all(np.isfinite(leaf)), (seed, jax.tree_util.keystr(path))
        seen += float(image[1].mean())
    assert seen / 12 > 0.01  # and something is drawn


@pytest.mark.slow
@pytest.mark.parametrize("model", [PINHOLE, EQUIRECTANGULAR])
def test_scenes_of_no_and_of_one_gaussian(model, scene_of, camera_of, config) -> None:
    camera = camera_of(model)
    for count in (0, 1):
        scene = jax.tree.map(lambda x: x[:count], scene_of())  # noqa: B023
        frame, buffers = render(scene, camera, config=config)

        def total(scene, buffers=buffers):
            return jnp.sum(rasterize(scene, camera, config=config, buffers=buffers).rgb)

        gradient = jax.grad(total, allow_int=True)(scene)
        weight = accumulated_weight(scene, camera, config=config, buffers=buffers)
        assert weight.shape == gradient.opacity_logits.shape == (count,)
        # float32 sums of n = 512 positive terms in another order: sqrt(n) eps = 3e-6 of the sum.
        np.testing.assert_allclose(float(weight.sum()), float(frame.alpha.sum()), rtol=1e-5)
        assert (count == 0) == (float(frame.alpha.sum()) == 0)
