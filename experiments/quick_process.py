"""What makes a command quick that runs most of its programs a few times, and most of whose time goes into making them.
Training has its own balance."""

import atexit
import gc
import os
import sys
from typing import NoReturn

# Most of a first job is compiling; XLA's newer way to fuse makes that a third longer, and what it makes is no faster
# over a whole job (benchmarks/README.md, "Time"). jax 0.10 and 0.11 know the flag; XLA ends at one that it does not.
_QUICK = "--xla_cpu_use_fusion_emitters=false"
_GARBAGE = 20_000  # objects after which Python looks for garbage: after its 700, that is a tenth of tracing's time


def begin_quickly() -> None:
    """Has XLA compile for a CPU the quicker way, if JAX has not begun; the user's own XLA_FLAGS come last and win. And
    has Python look for garbage seldom, and never among the modules that were imported."""
    flags = os.environ.get("XLA_FLAGS", "")
    if _QUICK.partition("=")[0] not in flags:
        os.environ["XLA_FLAGS"] = f"{_QUICK} {flags}".strip()
    if not gc.get_freeze_count():
        gc.freeze()
        gc.set_threshold(_GARBAGE, *gc.get_threshold()[1:])
        atexit.register(gc.unfreeze)  # or JAX's extensions complain of leaks


def end_quickly(code: int) -> NoReturn:
    """Ends the process with an exit code at once: all that it writes is written, and Python would take a second to
    take JAX's programs apart."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
