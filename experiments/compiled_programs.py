"""Compiled programs take maps of memory, of which Linux allows a process 65,530: at the limit XLA hangs or aborts."""

import gc
from pathlib import Path

import jax

MAPS = Path("/proc/self/maps")
MANY = 16_000  # a program that XLA compiled holds several


def forget_when_many() -> None:
    """Lets go of all compiled programs where they hold more than MANY maps; what is called again is compiled again, or
    read from the persistent cache."""
    if MAPS.exists() and MAPS.read_bytes().count(b"\n") > MANY:
        jax.clear_caches()
        gc.collect()
