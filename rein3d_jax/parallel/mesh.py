"""The devices of all hosts in one row, and arrays laid over them."""

import math
from typing import Any

import jax
import numpy as np
from jax.experimental import multihost_utils
from jax.sharding import AxisType, Mesh, NamedSharding, PartitionSpec

from rein3d_jax.errors import InputError

DATA = "data"  # the mesh's only axis: examples
_SMALL = 1024  # numbers in an array below which splitting it costs more than it saves


def join_hosts(address: str | None, count: int | None, index: int | None) -> None:
    """Joins `count` processes, so that they train as one; `address` is "host:port" of process 0, `index` this one's
    number. With none of them given nothing happens, and the job is one process's. Call it before anything else touches
    jax."""
    if (address, count, index) == (None, None, None):
        return
    if None in (address, count, index):
        raise InputError("several hosts need all of --address, --processes and --process")
    jax.distributed.initialize(address, count, index)


def data_mesh(devices: int = 0) -> Mesh:
    """A row of `devices` devices, as many of each host; 0 takes all. Raises InputError where there are fewer, or where
    they cannot be shared out so."""
    available, hosts = jax.devices(), jax.process_count()
    if devices > len(available):
        raise InputError(f"{devices} devices are asked for, but jax sees {len(available)}; lower devices, or 0 for all")
    if devices and hosts > 1:
        if devices % hosts:
            raise InputError(f"devices {devices} is not divided by {hosts} processes; make it a multiple, or 0 for all")
        each = devices // hosts
        available = [device for host in range(hosts) for device in jax.local_devices(host)[:each]]
    return Mesh(np.array(available[: devices or None]), (DATA,), axis_types=(AxisType.Auto,))


def share_batch(mesh: Mesh, batch: Any, axis: int = 0) -> Any:
    """Arrays of all hosts' examples laid over the mesh, from those of THIS host, along `axis`."""
    sharding = NamedSharding(mesh, PartitionSpec(*[None] * axis, DATA))
    return jax.tree.map(lambda x: jax.make_array_from_process_local_data(sharding, np.asarray(x)), batch)


def state_shardings(mesh: Mesh, tree: Any) -> Any:
    """Shardings of a tree of arrays over the mesh: each along its longest axis that the devices divide. What has none,
    or fewer than _SMALL numbers, is on every device."""

    def layout(array) -> NamedSharding:
        fitting = [axis for axis, size in enumerate(array.shape) if size % mesh.size == 0]
        if not fitting or math.prod(array.shape) < _SMALL:
            return NamedSharding(mesh, PartitionSpec())
        longest = max(fitting, key=lambda axis: array.shape[axis])
        return NamedSharding(mesh, PartitionSpec(*[None] * longest, DATA))

    return jax.tree.map(layout, tree)


def gather(tree: Any) -> Any:
    """NumPy arrays, whole, of those laid over the devices of all hosts. All hosts must call it where they are split."""
    return jax.tree.map(lambda x: _whole(x) if isinstance(x, jax.Array) else x, tree)


def _whole(array: jax.Array) -> np.ndarray:
    if array.is_fully_replicated:
        return np.asarray(array.addressable_data(0))
    return np.asarray(multihost_utils.process_allgather(array, tiled=True))
