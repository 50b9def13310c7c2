"""One training step over many devices: which they are (mesh), how the batch is shared out
(data_parallel), and processes that end together (tether)."""

from rein3d_jax.parallel.data_parallel import BACKENDS, data_parallel
from rein3d_jax.parallel.mesh import data_mesh, gather, join_hosts, share_batch, state_shardings
from rein3d_jax.parallel.tether import tethered

__all__ = [
    "BACKENDS",
    "data_mesh",
    "data_parallel",
    "gather",
    "join_hosts",
    "share_batch",
    "state_shardings",
    "tethered",
]
