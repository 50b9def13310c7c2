"""The packaged restorer: it is read without the check of its arrays' shapes, which traces the whole network."""

import shutil

from rein3d_jax.io.weights.restorer_weights import SHIPPED_RESTORER
from rein3d_jax.networks.trained import require_network
from rein3d_jax.restore import RestoreConfig


def test_the_packaged_restorer_holds_the_arrays_of_its_own_sizes(tmp_path):
    """As a file of one's own it is checked, and would be refused."""
    copy = shutil.copy(SHIPPED_RESTORER, tmp_path / "own.npz")
    require_network(RestoreConfig(method="learned", weights=str(copy), height=256))
