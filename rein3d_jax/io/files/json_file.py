"""JSON that a data set brings: parsed whole, its damage named; and file names in it, which may not leave its folder."""

import json
from pathlib import Path
from typing import Any

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.input_file import require_file

_MAX_BYTES = 512 * 2**20  # a parsed file takes several times its size


def read_json(path: Path) -> Any:
    """Parsed JSON of `path`. Raises InputError if it is missing, larger than _MAX_BYTES, or no JSON."""
    require_file(path)
    if (size := path.stat().st_size) > _MAX_BYTES:
        raise InputError(f"{path} has {size} bytes, more than {_MAX_BYTES}: give the scene's own JSON file")
    try:
        return json.loads(path.read_bytes())
    except (ValueError, RecursionError) as error:  # UnicodeDecodeError is a ValueError
        reason = " ".join(str(error).split())
        raise InputError(f"{path} is no JSON ({reason}): copy or export it again") from error


def path_within(folder: Path, name: str, *, named_by: Path) -> Path:
    """The file `name` of `folder`. Raises InputError, naming `named_by`, unless it stays inside: no absolute path,
    no "..", no link that leads out, no address."""
    try:
        stays = "://" not in name and (folder / name).resolve().is_relative_to(folder.resolve())
    except (OSError, RuntimeError, ValueError):  # a loop of links; a zero byte
        stays = False
    if not stays:
        raise InputError(f"{named_by} names the file {name!r} outside its folder: copy it into {folder}")
    return folder / name
