"""An input file that must be there."""

from pathlib import Path

from rein3d_jax.errors import InputError


def require_file(path: Path) -> None:
    """Raises InputError unless `path` is a file that can be read."""
    try:
        open(path, "rb").close()
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}): check the path") from error
