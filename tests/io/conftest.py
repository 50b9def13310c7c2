"""A disk that is full, for a while."""

import resource
from contextlib import contextmanager

import pytest


@pytest.fixture
def file_size_limit():
    """`with file_size_limit(n):` no file can grow beyond n bytes (EFBIG; Python ignores the signal)."""

    @contextmanager
    def limit(size):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limit
