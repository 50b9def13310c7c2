"""Tests compile many tiny programs once: fast compilation counts, fast code does not. What was compiled is kept for the
next run, in the folder that JAX_COMPILATION_CACHE_DIR names, or .jax_cache.

Value and gradient of the rasterizer: 13.5 s to compile as for use, 1.6 s with these flags. Set before jax starts; a
user's own XLA_FLAGS come last and win.
"""

import os
from pathlib import Path

import pytest

FAST_TO_COMPILE = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
os.environ["XLA_FLAGS"] = f"{FAST_TO_COMPILE} {os.environ.get('XLA_FLAGS', '')}".strip()
os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(__file__).resolve().parents[1] / ".jax_cache"))
os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0")

from experiments.compiled_programs import forget_when_many  # noqa: E402


def pytest_configure(config):
    """The order of files is the one below: xdist's own begins with those of many tests, which are the short ones."""
    config.option.loadscopereorder = False


def pytest_collection_modifyitems(config, items):
    """Measurements run where they are asked for (-m bench), not where another selection forgets to leave them out.
    Files with whole jobs come first: workers take file after file, and a long one at the end keeps one of them alone.
    """
    if "bench" not in (config.option.markexpr or ""):
        chosen = [item for item in items if item.get_closest_marker("bench") is None]
        config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
        items[:] = chosen
    slow = {item.path for item in items if item.get_closest_marker("slow")}
    items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(autouse=True, scope="module")
def forget_programs():
    """Lets go of the compiled programs of the tests so far where they have become many."""
    yield
    forget_when_many()
