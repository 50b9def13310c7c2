"""What this machine has, and which faults are its own: no memory, no disk, a platform that is not there."""

import os
import re
import resource
from pathlib import Path

import jax

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import NO_ROOM

_CONTAINER = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))
# As Python, XLA, C++ and OpenCV say it.
_NO_MEMORY = re.compile(r"RESOURCE_EXHAUSTED|out of memory|bad_alloc|(cannot|failed to) allocate", re.IGNORECASE)


def machine_bytes() -> int:
    """Its memory, or the part that a container or a limit (ulimit -v) leaves this process."""
    physical = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return min([physical, *_container_bytes(), *_limit_bytes()])


def require_float32() -> None:
    """Raises InputError where JAX computes in double precision: stages, files and programs are float32."""
    if jax.config.jax_enable_x64:
        raise InputError("JAX_ENABLE_X64 is set, but everything here is float32: unset JAX_ENABLE_X64")


def machine_fault(error: Exception, lighter: str) -> str | None:
    """The line that tells of an error which is the machine's, and the mend; `lighter` says how to take less memory.
    None for any other error: a bug."""
    said = " ".join(str(error).split())[:200] or type(error).__name__
    if isinstance(error, MemoryError) or _NO_MEMORY.search(said):
        return f"out of memory with {_used_bytes() / 1e9:.1f} GB in use ({said}): {lighter}"
    if isinstance(error, OSError) and error.errno in NO_ROOM:
        return f"{error.filename or 'a file'} cannot be written ({error.strerror}): free some space there"
    if jax.config.jax_platforms and not _platform_starts():
        named = f"JAX_PLATFORMS={jax.config.jax_platforms}"
        return f"{named} names a platform that JAX cannot start here: unset JAX_PLATFORMS, or set it to cpu"
    return None


def _container_bytes() -> list[int]:
    """Of a container's processes together."""
    said = [path.read_text("utf-8").strip() for path in _CONTAINER if path.exists()]
    return [int(number) for number in said if number.isdecimal()]  # not "max"


def _limit_bytes() -> list[int]:
    """Of the limit on addresses, which counts what is mapped but never touched, too: that much cannot be used."""
    limit, _ = resource.getrlimit(resource.RLIMIT_AS)
    if limit == resource.RLIM_INFINITY:
        return []
    mapped, touched = map(int, Path("/proc/self/statm").read_text("utf-8").split()[:2])
    return [max(limit - (mapped - touched) * os.sysconf("SC_PAGE_SIZE"), 0)]


def _used_bytes() -> int:
    """The most so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024


def _platform_starts() -> bool:
    try:
        return bool(jax.devices())
    except Exception:  # an AssertionError for cuda, a RuntimeError for others
        return False
