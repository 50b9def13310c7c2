"""Golden tensors that diffusers made (test_wan_parity.py), and the parameters among them."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import save_file

from rein3d_jax.io.weights.safetensors_folder import load_params
from rein3d_jax.restore.wan.config import TINY
from rein3d_jax.restore.wan.names import dit_rows, vae_rows
from rein3d_jax.restore.wan.training.memory import dit_shapes, vae_shapes


def _golden(name: str) -> dict[str, np.ndarray]:
    with np.load(Path(__file__).parent / "golden" / f"{name}.npz") as file:
        return dict(file)


def _with_params(case, folder, rows, shapes):
    save_file({row.name: case[row.name] for row in rows}, folder / "weights.safetensors")
    return case | {"params": load_params(folder, rows, shapes)}


@pytest.fixture(scope="session")
def golden_dit(tmp_path_factory):
    """Inputs, `params` and the velocity of TINY.dit, whose weights are far from any initialiser's."""
    shapes = dit_shapes(TINY.dit)
    return _with_params(_golden("dit"), tmp_path_factory.mktemp("dit"), dit_rows(shapes, TINY.dit, "diffusers"), shapes)


@pytest.fixture(scope="session")
def shallow_dit(golden_dit):
    """Parameters of `replace(TINY.dit, depth=2, control_every=1)`: every other of those main blocks, which compile in
    two thirds of the time."""
    steps = {name: leaf for name, leaf in golden_dit["params"]["steps"].items() if name != "block_1"}
    return golden_dit["params"] | {"steps": steps}


@pytest.fixture(scope="session")
def golden_vae(tmp_path_factory):
    """A video of 9 frames, `params`, the latents and the decoded video of TINY.vae."""
    shapes = vae_shapes(TINY.vae)
    return _with_params(_golden("vae"), tmp_path_factory.mktemp("vae"), vae_rows(shapes, TINY.vae, "diffusers"), shapes)


@pytest.fixture(scope="session")
def golden_unipc():
    """Noise and what diffusers' UniPC makes of it in 10 steps with v = sin(2 x) + t x / 1000."""
    return _golden("unipc")
