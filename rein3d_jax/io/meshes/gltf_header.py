"""What trimesh leaves out of a glTF file without a word is refused here: extensions it does not know, textures it
cannot place or open. Found by reading trimesh 5.2's exchange/gltf."""

import json
import struct
from io import BytesIO
from pathlib import Path
from typing import Any

from rein3d_jax.errors import InputError
from rein3d_jax.io.files.json_file import read_json

# Required extensions that change nothing of where triangles are and what base colour they have.
_HARMLESS = ("KHR_materials_", "KHR_lights_punctual", "EXT_texture_webp")
_FLOAT = 5126  # glTF's number for float32
_JSON, _BINARY = 0x4E4F534A, 0x004E4942  # the types of a GLB's chunks


def check_gltf(path: Path) -> None:
    """Raises InputError, naming `path`, if it is a glTF or GLB file that would lose something, or is damaged."""
    try:
        header, binary = _read_glb(path) if path.suffix.lower() == ".glb" else (read_json(path), b"")
        fault = _fault(header, binary)
    except InputError:
        raise
    except (AttributeError, IndexError, KeyError, TypeError, ValueError, RecursionError, struct.error) as error:
        reason = " ".join(repr(error).split())[:200]
        raise InputError(f"{path} is damaged or no {path.suffix[1:]} file ({reason}): export it again") from error
    if fault:
        raise InputError(f"{path} {fault}")


def _read_glb(path: Path) -> tuple[dict[str, Any], bytes]:
    data = path.read_bytes()
    magic, version, _ = struct.unpack_from("<4sII", data)
    if magic != b"glTF" or version != 2:
        raise ValueError(f"it begins with {magic!r}, version {version}")
    size, kind = struct.unpack_from("<II", data, 12)
    if kind != _JSON:
        raise ValueError("its first chunk is no JSON")
    header, rest = json.loads(data[20 : 20 + size]), data[20 + size :]
    return header, rest[8:] if len(rest) > 8 and struct.unpack_from("<II", rest)[1] == _BINARY else b""


def _fault(header: dict[str, Any], binary: bytes) -> str | None:
    """What the file has that would be lost, and the mend; None if there is nothing."""
    unknown = [name for name in header.get("extensionsRequired", ()) if not name.startswith(_HARMLESS)]
    if unknown:
        return f"requires {', '.join(unknown)}: export it without compression and extensions"
    for material in header.get("materials", ()):
        base = material.get("pbrMetallicRoughness", {}).get("baseColorTexture", {})
        if base.get("texCoord", 0) != 0:
            return "places a texture by its second coordinates: export it with one UV map"
        if "KHR_texture_transform" in base.get("extensions", {}):
            return "moves a texture by KHR_texture_transform: apply the mapping to the UV map, and export it again"
    primitives = [primitive for mesh in header.get("meshes", ()) for primitive in mesh["primitives"]]
    places = {primitive["attributes"].get("TEXCOORD_0") for primitive in primitives} - {None}
    if any(header["accessors"][index]["componentType"] != _FLOAT for index in places):
        return "holds texture coordinates as integers: export it with float coordinates"
    broken = [index for index, image in enumerate(header.get("images", ())) if not _opens(image, header, binary)]
    return f"holds picture {broken[0]}, which is no PNG, JPEG or WebP: export it again" if broken else None


def _opens(image: dict[str, Any], header: dict[str, Any], binary: bytes) -> bool:
    """Whether a picture inside the GLB can be opened; those beside the file are the resolver's matter."""
    import PIL.Image

    if "bufferView" not in image or not binary:
        return True
    view = header["bufferViews"][image["bufferView"]]
    start = view.get("byteOffset", 0)
    try:
        PIL.Image.open(BytesIO(binary[start : start + view["byteLength"]])).load()
    except (OSError, SyntaxError, ValueError, PIL.Image.DecompressionBombError):
        return False
    return True
