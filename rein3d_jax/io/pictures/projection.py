"""What a picture is that is no panorama, told by its shape and by what stands where: each kind with its mend."""

import numpy as np

_NEAR = 0.01  # relative deviation from a shape that is still that shape
_BLACK = 0.06  # sRGB; JPEG's noise on black stays below
_SHAPES = {
    6.0: "a cube map in a strip: convert it to equirectangular (e.g. with Hugin, or ffmpeg -vf v360=c6x1:e)",
    1 / 6: "a cube map in a strip: convert it to equirectangular (e.g. with ffmpeg -vf v360=c1x6:e)",
    4.0: "two panoramas side by side (left-right stereo): take its left half",
    1.5: "a photograph, or a cube map of 3 x 2: a panorama shows the whole sphere in 2:1",
    4 / 3: "a photograph, or a cube map's cross: a panorama shows the whole sphere in 2:1",
    16 / 9: "a photograph in perspective, or a video's frame: a panorama shows the whole sphere in 2:1",
    1.0: "a stereo pair (top-bottom), of which to take the upper half, or a fisheye picture, to be stitched first",
}


def is_sphere(width: int, height: int) -> bool:
    """Whether the shape is 2:1 but for a row or a column too many."""
    return abs(width / (2 * height) - 1) <= _NEAR


def what_shape_is(width: int, height: int) -> str:
    """What a picture of a shape that is not 2:1 may be, and what to do."""
    ratio = width / height
    for known, words in _SHAPES.items():
        if abs(ratio / known - 1) <= _NEAR:
            return f"it looks like {words}"
    return (
        "a panorama must be twice as wide as high: one that shows a part of the sphere has to be padded to 2:1 where "
        "it belongs, or say where in its GPano tags"
    )


def what_it_shows(rgb: np.ndarray) -> str:
    """What a 2:1 picture (h, 2 h, 3) in [0, 1] shows that is no panorama, and what to do; "" for a panorama."""
    if _two_circles(rgb):
        return "two fisheye circles side by side: stitch and export it in the camera's own app (e.g. Insta360 Studio)"
    if _halves_alike(rgb):
        return "a stereo pair squeezed to 2:1 (top-bottom): take its upper half and stretch that to 2:1"
    return ""


def _two_circles(rgb: np.ndarray) -> bool:
    """Both halves black in their corners and not in their middles."""
    height = len(rgb)
    v, u = np.mgrid[:height, :height]
    radius = np.hypot(v + 0.5 - height / 2, u + 0.5 - height / 2) / (height / 2)
    black = rgb.max(axis=-1) < _BLACK
    return all(half[radius > 1.1].mean() > 0.98 and half[radius < 0.9].mean() < 0.3 for half in np.split(black, 2, 1))


def _halves_alike(rgb: np.ndarray) -> bool:
    """Upper and lower half the same but for parallax: no room has its floor look like its ceiling in all detail."""
    rows = len(rgb) // 2
    # Steps from row to row: what only differs along the row, or smoothly, tells nothing.
    steps = [np.diff(half.mean(axis=-1), axis=0) for half in (rgb[:rows], rgb[-rows:])]
    detail = [step - step.mean() for step in steps]
    power = [np.sqrt(np.mean(d**2)) for d in detail]
    return min(power) > 0.004 and np.mean(detail[0] * detail[1]) > 0.3 * power[0] * power[1]
