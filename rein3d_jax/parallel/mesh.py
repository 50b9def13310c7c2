"""The devices of all hosts in one row, and arrays laid over them."""

from typing import Any

import jax
import numpy as np
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

from rein3d_jax.errors import InputError

DATA = "data"  # the mesh's only axis: examples


def join_hosts(address: str | None, count: int | None, index: int | None) -> None:
    """Let `count` processes train as one; `address` is "host:port" of process 0, `index` this one's number. With none
    of them given nothing happens, and the job is one process's. Call it before anything else touches jax."""
    if (address, count, index) == (None, None, None):
        return
    if None in (address, count, index):
        raise InputError("several hosts need all of --address, --processes and --process")
    jax.distributed.initialize(address, count, index)


def data_mesh(devices: int = 0) -> Mesh:
    """A row of the first `devices` devices; 0 takes all, of all hosts. Raises InputError where there are fewer."""
    available = jax.devices()
    if devices > len(available):
        raise InputError(f"{devices} devices are asked for, but jax sees {len(available)}; lower devices, or 0 for all")
    return Mesh(np.array(available[: devices or None]), (DATA,), axis_types=(AxisType.Auto,))


def share_batch(mesh: Mesh, batch: Any, axis: int = 0) -> Any:
    """Arrays of THIS host's examples, along `axis`, as arrays of all hosts' examples laid over the mesh."""
    sharding = NamedSharding(mesh, PartitionSpec(*[None] * axis, DATA))
    return jax.tree.map(lambda x: jax.make_array_from_process_local_data(sharding, np.asarray(x)), batch)


def gather(tree: Any) -> Any:
    """Replicated arrays, which every host holds whole, as NumPy's."""
    return jax.tree.map(lambda x: np.asarray(x.addressable_data(0)) if isinstance(x, jax.Array) else x, tree)
