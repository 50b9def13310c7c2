"""A scene's file, its format by its suffix: .ply (3DGS), .compressed.ply (SuperSplat), .spz, .splat; .sog to write."""

from collections.abc import Callable
from pathlib import Path

from rein3d_jax.errors import InputError
from rein3d_jax.io.splats.compressed_ply import is_compressed_ply, read_compressed_ply, write_compressed_ply
from rein3d_jax.io.splats.ply import read_ply, write_ply
from rein3d_jax.io.splats.sog import write_sog
from rein3d_jax.io.splats.splat import read_splat, write_splat
from rein3d_jax.io.splats.spz import read_spz, write_spz
from rein3d_jax.io.splats.up_axis import UP_AXES, with_up
from rein3d_jax.scene import Gaussians


def _read_any_ply(path: str | Path) -> Gaussians:
    """Other tools name both kinds .ply."""
    return read_compressed_ply(path) if is_compressed_ply(path) else read_ply(path)


_FORMATS: dict[str, tuple[Callable[..., Gaussians], Callable[..., None]]] = {
    ".compressed.ply": (_read_any_ply, write_compressed_ply),
    ".ply": (_read_any_ply, write_ply),
    ".spz": (read_spz, write_spz),
    ".splat": (read_splat, write_splat),
}

_OTHERS = (".ksplat", ".sog", ".lcc")  # what a converter makes a .ply of


def read_splats(path: str | Path) -> Gaussians:
    """The scene in `path`, every slot alive, in the axes of ply.py. Raises InputError for a suffix that is none of
    these, and for what the format's reader refuses."""
    if (suffix := Path(path).suffix.lower()) in _OTHERS:
        mend = "convert it to .ply, with `npx @playcanvas/splat-transform` or superspl.at/editor"
        raise InputError(f"{path} is a {suffix} scene, which is not read here: {mend}")
    return _format(path)[0](path)


def write_splats(path: str | Path, gaussians: Gaussians, *, antialias: bool = False, up: str = "z") -> None:
    """Writes the alive slots to `path`, atomically; what a format cannot hold is in its module. `antialias` is
    write_ply's; .compressed.ply and .splat have no place for it. `up` is one of UP_AXES: the axes of the scene that
    read_splats, or a converter to PLY, gets back. Raises InputError."""
    write = write_sog if Path(path).suffix.lower() == ".sog" else _format(path)[1]
    told = {"antialias": antialias} if write in (write_ply, write_spz, write_sog) else {}
    told |= {"axes": UP_AXES[up][1]} if write is write_ply else {}
    write(path, with_up(gaussians, up), **told)


def _format(path: str | Path) -> tuple[Callable[..., Gaussians], Callable[..., None]]:
    name = Path(path).name.lower()
    for suffix, format in _FORMATS.items():
        if name.endswith(suffix):
            return format
    raise InputError(f"{path} has no scene format known by its suffix: end it in {', '.join(_FORMATS)}")
