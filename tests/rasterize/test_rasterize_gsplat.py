"""gsplat's torch reference as an independent oracle: projection, harmonics, a whole picture and its gradients.

pip install -e '.[bench]' && python -m pytest -m bench tests/rasterize/test_rasterize_gsplat.py
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.spherical_harmonics import rgb_from_sh
from rein3d_jax.rasterize import allocate, rasterize
from rein3d_jax.rasterize.project import project

pytestmark = pytest.mark.bench
torch = pytest.importorskip("torch")
pytest.importorskip("gsplat")
from gsplat.cuda import _torch_impl as oracle  # noqa: E402

from benchmarks.engines import gsplat_torch  # noqa: E402
from benchmarks.engines.ours import CONFIG, camera_of, scene_of  # noqa: E402
from benchmarks.workloads import Size, make_workload  # noqa: E402

SIZE = Size(300, 0.1, 96, 72)


def leaves_of(workload):
    names = ("means", "scales", "quats", "opacities", "colours")
    return [torch.tensor(getattr(workload, name), requires_grad=True) for name in names]


def ordered(workload):
    """The workload with its splats so far apart in depth that order by z, gsplat's, is order by distance, ours."""
    distance = np.linalg.norm(workload.means, axis=1, keepdims=True)
    steps = np.linspace(1.0, 4.0, SIZE.count)[:, None]
    direction = (
        workload.means / distance * np.array([0.05, 0.05, 1.0])
    )  # a narrow cone, in which z is nearly the distance
    direction[:, 2] = np.abs(direction[:, 2]) + 1.0
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    workload.means[:] = direction * steps**3
    workload.scales[:] *= steps**3 * 0.6
    return workload


def test_projection_agrees() -> None:
    workload = make_workload(SIZE)
    means, scales, quats, *_ = leaves_of(workload)
    covariance, _ = oracle._quat_scale_to_covar_preci(quats, scales, compute_preci=False)
    f = workload.focal
    intrinsics = torch.tensor([[[f, 0, 48], [0, f, 36], [0, 0, 1]]], dtype=torch.float32)
    radii, flat, _, conics, _ = oracle._fully_fused_projection(
        means, covariance, torch.eye(4)[None], intrinsics, 96, 72
    )
    splats = project(scene_of(workload), camera_of(workload), config=CONFIG)
    seen = np.asarray(splats.visible) & (radii[0] > 0).all(-1).numpy()
    assert seen.sum() > 20 and not np.any(np.asarray(splats.visible) & ~seen)
    np.testing.assert_allclose(splats.mean[seen], flat[0].detach()[seen], rtol=1e-4, atol=1e-3)  # pixels, to 100
    inverse = np.einsum("nji,njk->nik", splats.axes, splats.axes)[seen]
    expected = conics[0].detach().numpy()[seen]
    # 1 / pixel^2, up to 3; needles lose digits in gsplat's determinant.
    np.testing.assert_allclose(inverse[:, [0, 0, 1], [0, 1, 1]], expected, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_harmonics_agree(degree) -> None:
    rng = np.random.default_rng(degree)
    direction = rng.normal(size=(50, 3)).astype(np.float32)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    sh = rng.normal(size=(50, (degree + 1) ** 2, 3)).astype(np.float32)
    expected = oracle._spherical_harmonics(degree, torch.tensor(direction), torch.tensor(sh)).numpy() + 0.5
    actual = rgb_from_sh(jnp.asarray(sh), jnp.asarray(direction))
    np.testing.assert_allclose(actual, np.maximum(expected, 0.0), atol=1e-5)  # sums of 16 float32 terms


def test_picture_and_gradient_agree() -> None:
    workload = ordered(make_workload(SIZE))
    z = workload.means[:, 2]
    assert np.array_equal(np.argsort(z), np.argsort(np.linalg.norm(workload.means, axis=1)))
    scene, camera, target = scene_of(workload), camera_of(workload), jnp.asarray(workload.target)
    buffers = allocate(scene, [camera], config=CONFIG)

    def loss(means, log_scales, quats):
        moved = scene.replace(means=means, log_scales=log_scales, quats=quats)
        image = rasterize(moved, camera, config=CONFIG, buffers=buffers).rgb
        return jnp.mean((image - target) ** 2), image

    gradient = jax.grad(loss, argnums=(0, 1, 2), has_aux=True)
    ours, image = gradient(scene.means, scene.log_scales, scene.quats)
    leaves = leaves_of(workload)
    theirs = gsplat_torch.render(*leaves, workload.focal, SIZE.width, SIZE.height)
    assert float(theirs.detach().mean()) > 0.02
    # A pixel at which alpha rounds to the other side of the 1/255 cut may differ by as much.
    error = np.abs(np.asarray(image) - theirs.detach().numpy())
    assert np.quantile(error, 0.999) < 1e-4 and error.max() < 5e-3
    expected = torch.autograd.grad(torch.mean((theirs - torch.tensor(workload.target)) ** 2), leaves[:3])
    expected = [x.numpy() for x in expected]
    expected[1] = expected[1] * workload.scales  # by the logarithm
    for name, actual, value in zip(("means", "scales", "quats"), ours, expected, strict=True):
        assert np.linalg.norm(actual - value) < 2e-3 * np.linalg.norm(value), name  # float32 on both sides
