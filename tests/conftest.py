"""Tests compile many tiny programs once: fast compilation counts, fast code does not.

Value and gradient of the rasterizer: 13.5 s to compile as for use, 1.6 s with these flags. Set before jax starts; a
user's own XLA_FLAGS come last and win.
"""

import os

import pytest

FAST_TO_COMPILE = "--xla_backend_optimization_level=0 --xla_cpu_use_fusion_emitters=false"
os.environ["XLA_FLAGS"] = f"{FAST_TO_COMPILE} {os.environ.get('XLA_FLAGS', '')}".strip()

from experiments.compiled_programs import forget_when_many  # noqa: E402


@pytest.fixture(autouse=True, scope="module")
def forget_programs():
    """Lets go of the compiled programs of the tests so far where they have become many."""
    yield
    forget_when_many()
