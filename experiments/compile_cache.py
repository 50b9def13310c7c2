"""The folder of compiled programs: with it a second run starts two minutes sooner."""

import os
import sys
import warnings
from pathlib import Path

import jax


def use_compile_cache() -> None:
    """Stores compiled programs in the user's home, unless JAX_COMPILATION_CACHE_DIR names a folder; all of them, since
    the hundreds that compile in less than JAX's second take a minute together. Where nothing can be stored, says so
    once: JAX itself would warn once a program."""
    warnings.filterwarnings("ignore", "Error writing persistent compilation cache entry")
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    folder = jax.config.jax_compilation_cache_dir or _at_home()
    if not _takes_files(folder):
        where = f"{folder} cannot be written" if folder else "there is no home folder"
        print(f"compiled programs are not kept, {where}: set JAX_COMPILATION_CACHE_DIR", file=sys.stderr)
        folder = None
    jax.config.update("jax_compilation_cache_dir", folder)


def _at_home() -> str | None:
    try:
        return str(Path.home() / ".cache" / "rein3d_jax")
    except RuntimeError:  # no HOME, and a user without a name, as in many a container
        return None


def _takes_files(folder: str | None) -> bool:
    if folder is None or "://" in folder:  # JAX writes into buckets, too
        return folder is not None
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK)
