"""How XLA makes a CPU's programs. Most of a first job is compiling; XLA's newer way to fuse makes that a third longer,
and what it makes is no faster over a whole job (benchmarks/README.md, "Time")."""

import os

_QUICK = "--xla_cpu_use_fusion_emitters=false"  # jax 0.10 and 0.11 know it; XLA ends at a flag that it does not know


def compile_quickly() -> None:
    """Has programs compiled the quicker way, if JAX has not begun; the user's own XLA_FLAGS come last and win. For
    commands that run most programs a few times: training has its own balance."""
    flags = os.environ.get("XLA_FLAGS", "")
    if _QUICK.partition("=")[0] not in flags:
        os.environ["XLA_FLAGS"] = f"{_QUICK} {flags}".strip()
