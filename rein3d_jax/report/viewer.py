"""The viewer page, one HTML file to move through a scene in, by keys, fingers, gamepad or headset: opened by a double
click, it asks nothing of the network.

Pure: scenes and panorama come in encoded, the page goes out as text. A policy in the page forbids every request. The
page's parts are this package's viewer_page/; its libraries (three and Spark, MIT) were bundled by
benchmarks/viewer_build.
"""

import base64
import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files

import numpy as np

from rein3d_jax.report.floor_map import FloorMap
from rein3d_jax.report.report import Picture, picture_uri

# Workers and WebAssembly of the bundle come from the page itself, as blobs and data.
_POLICY = (
    "default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; worker-src data: blob:; "
    "connect-src data: blob:; script-src 'unsafe-inline' 'wasm-unsafe-eval' data: blob:"
)
_SERVED_POLICY = _POLICY.replace("connect-src", "connect-src 'self'")
# One script, in this order.
_CODE = ("place", "draw_list", "splats", "picture", "map", "hands", "keepsakes", "headset", "walk")
_PIXEL_FILTER = ("added", 0.3)  # 3DGS'; a scene of ours comes with its RasterizeConfig's


def render_viewer(
    scenes: Mapping[str, bytes | str],
    panorama: bytes | None,
    floor_map: FloorMap,
    *,
    title: str = "Your room in 3D",
    backdrop: Sequence[float] = (0.5, 0.5, 0.5),
    pixel_filter: tuple[str, float] = _PIXEL_FILTER,
) -> str:
    """HTML of the whole page. `scenes`: name -> the bytes of an SPZ file, the last one shown first; or all of them
    paths on the server that the page comes from, fetched when they are shown. `panorama`: a JPEG or PNG file.
    `floor_map`: walls, paths, and the safe area, which the visitor does not leave. `backdrop`: the sRGB colour of what
    no splat covers. `pixel_filter`: the rasterizer's kind of filter, its variance in pixels^2. Raises ValueError for a
    scene or picture of another format."""
    served = all(isinstance(data, str) for data in scenes.values())
    if not scenes or not (served or all(_is_spz(data) for data in scenes.values())):
        raise ValueError("a viewer's scenes are one SPZ file or more, or all of them paths on its server")
    payload = {
        "scenes": [
            {"name": name} | ({"url": data} if served else {"spz": base64.b64encode(data).decode()})
            for name, data in scenes.items()
        ],
        "panorama": picture_uri(Picture("panorama", panorama)) if panorama is not None else None,
        "walls": _points(floor_map.walls),
        "safe": _points(floor_map.safe),
        "paths": [_points(path) for path in floor_map.paths],
        "backdrop": [float(value) for value in backdrop],
        "pixelFilter": dict(zip(("kind", "variance"), pixel_filter, strict=True)),
    }
    parts = {
        "title": escape(title),
        "policy": _SERVED_POLICY if served else _POLICY,
        "style": _file("page.css"),
        "licences": escape(_file("LICENCES.txt")),
        "data": json.dumps(payload, allow_nan=False).replace("<", "\\u003c"),  # no name can end the script
        "bundle": _file("bundle.js"),
        "walk": "".join(_file(f"{name}.js") for name in _CODE),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _file("page.html"))


def _file(name: str) -> str:
    return files(__package__).joinpath("viewer_page", name).read_text("utf-8")


def _is_spz(data: bytes | str) -> bool:
    return isinstance(data, bytes) and data.startswith(b"\x1f\x8b")


def _points(points: np.ndarray) -> list[list[float]]:
    """(n, 2) metres, to the millimetre."""
    return [[round(float(x), 3), round(float(y), 3)] for x, y in np.asarray(points).reshape(-1, 2)]
