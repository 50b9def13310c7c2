"""Whole files or none: what is written appears under its name at once, and what stood there stays until then."""

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rein3d_jax.errors import InputError

NO_ROOM = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}
_UNKNOWN = {errno.EINVAL, errno.ENOTSUP, errno.ENOSYS, errno.EBADF}  # what a file system answers that cannot do it


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yields a temporary path beside `path`, with its suffix; write that file in the body, and close it.

    When the body ends, the file is synced and takes the name `path`; if anything fails it is removed and an
    earlier `path` is untouched. Parent folders are made. The body must only write: an OSError in it becomes
    an InputError that names `path`, the reason and the mend.
    """
    path = Path(path)
    temporary = path.with_name(f".{path.stem}.{secrets.token_hex(4)}{path.suffix}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield temporary
        _sync(temporary)
        os.replace(temporary, path)
        _sync_folder(path.parent)  # the new name itself must survive a power cut
    except OSError as error:
        raise InputError(_explain(path, error)) from error
    finally:
        if os.path.lexists(temporary):  # never raises, unlike unlink under a file that should be a folder
            temporary.unlink()


def write_bytes(path: str | Path, data: bytes) -> None:
    """Writes `data` to `path`, whole or not at all. Raises InputError."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data)


def write_text(path: str | Path, text: str) -> None:
    """Writes `text` to `path` as UTF-8, whole or not at all. Raises InputError."""
    try:
        data = text.encode()
    except UnicodeEncodeError as error:  # Python reads such a name with lone surrogates
        told = "it would hold the name of a file or folder that is not Unicode"
        raise InputError(f"{path} cannot be written ({told}): rename that one") from error
    write_bytes(path, data)


def _sync(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def _sync_folder(path: Path) -> None:
    """Where folders can be synced: network shares refuse it, Windows does not even open one. The file is safe."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return
    try:
        os.fsync(descriptor)
    except OSError as error:
        if error.errno not in _UNKNOWN:
            raise
    finally:
        os.close(descriptor)


def _explain(path: Path, error: OSError) -> str:
    reason = " ".join((error.strerror or str(error)).split())
    mend = "free some space there" if error.errno in NO_ROOM else "choose an output path that can be written"
    return f"{path} cannot be written ({reason}): {mend}"
