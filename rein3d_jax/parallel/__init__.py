"""One training step over many devices: which they are (mesh), and how the batch is shared out (data_parallel)."""

from rein3d_jax.parallel.data_parallel import BACKENDS, data_parallel
from rein3d_jax.parallel.mesh import data_mesh, gather, join_hosts, share_batch, state_shardings

__all__ = ["BACKENDS", "data_mesh", "data_parallel", "gather", "join_hosts", "share_batch", "state_shardings"]
