"""Published weights that only exist as pickles, read without running what a pickle may hold: arrays, nothing else."""

import pickle
from typing import IO, Any

import numpy as np

_reconstruct = np.empty(0).__reduce__()[0]  # numpy's own, wherever this version keeps it
_ALLOWED = {
    ("numpy.core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy._core.multiarray", "_reconstruct"): _reconstruct,
    ("numpy", "ndarray"): np.ndarray,
    ("numpy", "dtype"): np.dtype,
}


class _ArrayUnpickler(pickle.Unpickler):
    def find_class(self, module: str, name: str) -> Any:
        if (module, name) not in _ALLOWED:
            raise pickle.UnpicklingError(f"{module}.{name} is no array: refused")
        return _ALLOWED[module, name]


def load_arrays(stream: IO[bytes]) -> Any:
    """Nested dicts and lists of arrays, numbers and strings. Raises pickle.UnpicklingError at anything else."""
    return _ArrayUnpickler(stream).load()
