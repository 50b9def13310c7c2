"""The folder of compiled programs: with it a second run starts two minutes sooner."""

from pathlib import Path

import jax


def use_compile_cache() -> None:
    """Stores compiled programs in the user's home, unless JAX_COMPILATION_CACHE_DIR names one; all of them, since the
    hundreds that compile in less than JAX's second take a minute together."""
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    if not jax.config.jax_compilation_cache_dir:
        jax.config.update("jax_compilation_cache_dir", str(Path.home() / ".cache" / "rein3d_jax"))
