"""From Cycles to files: linear colour and exact distance, automatic exposure, development to sRGB."""

import os
import sys
import tempfile

import bpy
import numpy as np

_NOTHING = 1e9  # Cycles' distance where a ray meets nothing
_GREY = 0.24  # what the mean of a well exposed interior is, linear
_WHITE = 0.95  # and its brightest tenth at the most


def render_view() -> tuple[np.ndarray, np.ndarray]:
    """Linear colour (h, w, 3), denoised, and distance along the ray (h, w) in metres, 0 where nothing is met.

    Distance is taken by a second rendering of one sample through each pixel's centre."""
    scene = bpy.context.scene
    samples = scene.cycles.samples
    linear = _render(("Combined",))["Combined"]
    bounces = scene.cycles.max_bounces
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.use_denoising = 1, 0, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 0.01
    distance = _render(("Depth",))["Depth"][..., 0]
    scene.cycles.samples, scene.cycles.max_bounces, scene.cycles.use_denoising = samples, bounces, True
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", 1.5
    return np.nan_to_num(linear[..., :3]), np.where(distance < _NOTHING, distance, 0.0)


def _render(wanted: tuple[str, ...]) -> dict[str, np.ndarray]:
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "view.exr")
        bpy.context.scene.render.filepath = path
        bpy.ops.render.render(write_still=True)
        return _read_passes(path, wanted)


def _read_passes(path: str, wanted: tuple[str, ...]) -> dict[str, np.ndarray]:
    """Passes of a multilayer EXR by name, with the OpenImageIO that Blender brings."""
    packages = os.path.join(bpy.utils.resource_path("LOCAL"), "python", "lib", "python3.11", "site-packages")
    if packages not in sys.path:
        sys.path.append(packages)
    import OpenImageIO

    source = OpenImageIO.ImageInput.open(path)
    found = {}
    part = 0
    while source.seek_subimage(part, 0):
        names = source.spec().channelnames
        pixels = np.asarray(source.read_image(part, 0, 0, len(names), "float"), np.float32)
        for name in wanted:
            at = [i for i, channel in enumerate(names) if f".{name}." in f".{channel}"]
            if at:
                order = sorted(at, key=lambda i: "RGBAXYZV".find(names[i].split(".")[-1]))
                found[name] = pixels.reshape(source.spec().height, source.spec().width, -1)[..., order]
        part += 1
    source.close()
    return found


def exposure_gains(linear: np.ndarray, look: dict) -> tuple[float, float, float]:
    """Gains of red, green, blue that expose and, in part, balance a linear panorama."""
    rows = (0.5 - (np.arange(len(linear)) + 0.5) / len(linear)) * np.pi
    weight = np.repeat(np.cos(rows)[:, None], linear.shape[1], axis=1).ravel()
    flat = linear.reshape(-1, 3)
    luminance = flat @ np.array([0.2126, 0.7152, 0.0722])
    kept = (luminance <= np.quantile(luminance, 0.93)) & (luminance > 1e-6)  # bright windows do not count
    mean = np.exp(np.average(np.log(luminance[kept] + 1e-6), weights=weight[kept]))
    colour = np.average(flat[kept], axis=0, weights=weight[kept]) + 1e-6
    balance = (colour.mean() / colour) ** look["balance"]
    bright = np.quantile(luminance[kept], 0.9)
    return tuple(min(_GREY / mean * 2 ** look["stops"], _WHITE / bright) * balance)


def develop(linear: np.ndarray, gains: tuple, look: dict) -> tuple[np.ndarray, np.ndarray]:
    """sRGB in [0, 1] with a soft shoulder, and the linear picture at the same exposure."""
    exposed = np.maximum(linear * np.array(gains, np.float32), 0.0)
    grey = exposed @ np.array([0.2126, 0.7152, 0.0722], np.float32)
    vivid = np.maximum(grey[..., None] + look["saturation"] * (exposed - grey[..., None]), 0.0)
    knee = 1.0 - 0.6 * look["shoulder"]  # linear below, rolling off to 1 above
    rolled = knee + (1 - knee) * (1 - np.exp(-(np.maximum(vivid, knee) - knee) / (1 - knee)))
    toned = np.where(vivid < knee, vivid, rolled)
    srgb = np.where(toned <= 0.0031308, 12.92 * toned, 1.055 * np.maximum(toned, 1e-8) ** (1 / 2.4) - 0.055)
    return np.clip(srgb, 0, 1), np.minimum(exposed, 6e4)


def write_picture(srgb: np.ndarray, path: str) -> None:
    """An 8-bit PNG of `srgb` (h, w, 3)."""
    height, width = srgb.shape[:2]
    image = bpy.data.images.new("picture", width, height, alpha=False, float_buffer=False)
    image.pixels.foreach_set(np.concatenate([srgb[::-1], np.ones((height, width, 1))], -1).astype(np.float32).ravel())
    image.filepath_raw, image.file_format = path, "PNG"
    image.save()
    bpy.data.images.remove(image)
