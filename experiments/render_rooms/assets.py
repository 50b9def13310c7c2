"""Furniture models and photographed textures: Sweet Home 3D's catalogs, unpacked once, with licences."""

import re
import subprocess
import zipfile
from collections import defaultdict
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.render_rooms.kinds import MODEL_KINDS
from rein3d_jax.errors import InputError

_PACKAGES = ("sweethome3d-furniture", "sweethome3d")
_BY, _BY_US, _ZERO = "CC-BY 3.0", "CC-BY 3.0 US", "CC0"
_LIBRARIES = {"Scopia": _BY, "KatorLegaz": _BY_US, "BlendSwap-CC-BY": _BY, "BlendSwap-CC-0": _ZERO}
_LETTERS = {"Scopia": "S", "KatorLegaz": "K", "BlendSwap-CC-BY": "B", "BlendSwap-CC-0": "Z"}
_TEXTURE_LIST = "com/eteks/sweethome3d/io/DefaultTexturesCatalog.properties"


@dataclass(frozen=True)
class FurnitureModel:
    """One model of a catalog; its front looks along -y once it stands in a room."""

    key: str  # letter of the library, colon, the catalog's own name
    path: str  # the OBJ file
    size: tuple[float, float, float]  # metres: width, depth, height
    elevation: float  # metres above the floor where it hangs, else 0
    top: float | None  # metres above its own foot where things may be put; None where nothing may
    rotation: tuple[float, ...] | None  # 3x3 rows, in the OBJ's own axes, before it is fitted into `size`
    credit: tuple[str, str, str, str]  # name, author, library, licence


@dataclass(frozen=True)
class PhotoTexture:
    """A photographed, tileable texture."""

    name: str
    path: str
    size: tuple[float, float]  # metres that one tile covers
    place: str  # "Floor", "Wall" or "Sky"


@dataclass(frozen=True)
class Catalog:
    """All that rooms are furnished with."""

    models: dict[str, tuple[FurnitureModel, ...]]  # by kind
    textures: tuple[PhotoTexture, ...]


def load_catalog(folder: Path) -> Catalog:
    """The catalogs under `folder`, unpacked from its Debian packages where that was not done yet."""
    for package in _PACKAGES:
        _unpack_package(folder, package)
    share = "usr/share/sweethome3d"
    models = {}
    for library in _LIBRARIES:
        archive = folder / "sweethome3d-furniture" / share / "furniture" / f"{library}.sh3f"
        models |= _library_models(_unzip(archive, folder / "models" / library, ""), library)
    jar = folder / "sweethome3d" / share / "sweethome3d.jar"
    textures = _textures(_unzip(jar, folder / "textures", "com/eteks/sweethome3d/io/"))
    kinds = {kind: tuple(models[key] for key in keys.split() if key in models) for kind, keys in MODEL_KINDS.items()}
    return Catalog(kinds, textures)


def pick_model(
    rng: np.random.Generator, catalog: Catalog, kind: str, most: tuple[float, float, float] = (99, 99, 99)
) -> FurnitureModel | None:
    """One model of `kind` no larger than `most` metres, by chance; None where there is none."""
    fitting = [model for model in catalog.models[kind] if all(s <= m for s, m in zip(model.size, most, strict=True))]
    return fitting[rng.integers(len(fitting))] if fitting else None


def _unpack_package(folder: Path, package: str) -> None:
    if (folder / package / "usr").exists():
        return
    found = sorted(folder.glob(f"{package}_*.deb"))
    if not found:
        raise InputError(f"{folder} holds no {package}_*.deb; run there: apt-get download {' '.join(_PACKAGES)}")
    subprocess.run(["dpkg-deb", "-x", found[-1], folder / package], check=True)


def _unzip(archive: Path, target: Path, prefix: str) -> Path:
    """Whole or nothing: a folder that exists is complete."""
    if not target.exists():
        partial = target.with_name(target.name + ".partial")
        with zipfile.ZipFile(archive) as packed:
            packed.extractall(partial, [name for name in packed.namelist() if name.startswith(prefix)])
        partial.rename(target)
    return target


def _entries(properties: Path) -> list[dict[str, str]]:
    """The numbered entries of a catalog: `name#7=Sofa` becomes name: Sofa of entry 7."""
    entries: dict[int, dict[str, str]] = defaultdict(dict)
    for line in properties.read_text("latin1").splitlines():
        if match := re.match(r"(\w+)#(\d+)=(.*)", line):
            entries[int(match[2])][match[1]] = match[3].strip()
    return [entries[number] for number in sorted(entries)]


def _library_models(folder: Path, library: str) -> dict[str, FurnitureModel]:
    models = [_model(folder, library, entry) for entry in _entries(folder / "PluginFurnitureCatalog.properties")]
    return {model.key: model for model in models}


def _model(folder: Path, library: str, entry: dict[str, str]) -> FurnitureModel:
    size = tuple(0.01 * float(entry[side]) for side in ("width", "depth", "height"))
    drop = 0.01 * float(entry.get("dropOnTopElevation", 100 * size[2]))
    rotation = entry.get("modelRotation")
    return FurnitureModel(
        key=f"{_LETTERS[library]}:{entry['id'].split('#')[1]}",
        path=str(folder / entry["model"].lstrip("/")),
        size=size,
        elevation=0.01 * float(entry.get("elevation", 0)),
        top=drop if drop > 0 else None,
        rotation=tuple(map(float, rotation.split())) if rotation else None,
        credit=(entry["name"], entry.get("creator", "Sweet Home 3D"), f"Sweet Home 3D {library}", _LIBRARIES[library]),
    )


def _textures(folder: Path) -> tuple[PhotoTexture, ...]:
    return tuple(
        PhotoTexture(
            name=entry["id"].split("#")[1],
            path=str(folder / entry["image"].lstrip("/")),
            size=(0.01 * float(entry["width"]), 0.01 * float(entry["height"])),
            place=entry["category"],
        )
        for entry in _entries(folder / _TEXTURE_LIST)
    )
