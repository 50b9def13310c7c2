"""Errors of a splat's footprint on a panorama against Monte Carlo, from the horizon to the pole, beside plain EWA.

The footprint is measured where a user sees it: second moments of the rendered alpha over the sphere. Plain EWA is the
affine approximation in longitude and latitude, with which many panoramic splatters draw: its ellipse in pixels, drawn
exactly. Truth is the distribution of the Gaussian's own points, seen from the camera.
"""

import io
import json
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from rein3d_jax.conventions import ALPHA_CUT
from rein3d_jax.geometry.poses import equirectangular_camera, upright
from rein3d_jax.geometry.rotations import quats_from_matrix
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles
from rein3d_jax.io.files.atomic import write_bytes, write_text
from rein3d_jax.rasterize import RasterizeConfig, render
from rein3d_jax.scene import Gaussians

LATITUDES = (0.0, 45.0, 75.0, 85.0, 88.0, 89.0, 89.5, 89.9)  # degrees
SIGMAS = (0.001, 0.003, 0.01, 0.03, 0.1, 0.2, 0.3)  # sigma / distance
SAMPLES = 400_000
OPACITY = 0.99
AZIMUTH = 0.7


def _frame(latitude):
    """Direction, east and north (3, 3) at a latitude."""
    flat, up = np.cos(latitude), np.sin(latitude)
    direction = np.array([flat * np.cos(AZIMUTH), -flat * np.sin(AZIMUTH), up])
    east = np.array([-np.sin(AZIMUTH), -np.cos(AZIMUTH), 0.0])
    return np.stack([direction, east, np.cross(direction, east) * np.sign(np.cross(direction, east)[2] or 1)])


def _moments(rays, weights, frame):
    """Second moments (2, 2) along east and north of unit rays about the splat's direction."""
    offset = rays @ frame[1:].T
    return np.einsum("n,ni,nj->ij", weights, offset, offset) / weights.sum()


def _within(rays, weights, frame, reach):
    """Rays and weights in the cap where alpha reaches the 1/255 cut: beyond it nothing is drawn."""
    inside = rays @ frame[0] > np.cos(min(reach, np.pi))
    return rays[inside], weights[inside]


def _error(actual, truth):
    return float(np.linalg.norm(actual - truth) / np.linalg.norm(truth))


def _height(sigma: float) -> int:
    """Rows of a panorama in which the splat's sigma is 5 pixels or more: the filter leaves that as it is."""
    return int(min(2048, max(64, 2 ** np.ceil(np.log2(6 * np.pi / sigma)))))


def footprint_errors(latitude: float, sigma: float, seed: int = 0) -> dict:
    """Relative errors of second moments, ours and plain EWA's, for a tilted disc of `sigma` and half of it."""
    frame = _frame(np.radians(latitude))
    rng = np.random.default_rng(seed)
    axes = np.array([sigma, sigma / 2, sigma / 2])  # east, north, depth
    points = frame[0] + (rng.normal(size=(SAMPLES, 3)) * axes) @ np.stack([frame[1], frame[2], frame[0]])
    truth_rays = points / np.linalg.norm(points, axis=1, keepdims=True)
    # A splat's alpha is cut at 1/255, and so are sampled points.
    height = _height(sigma)
    rays = np.asarray(pixel_rays(height, 2 * height), np.float64).reshape(-1, 3)
    area = np.asarray(pixel_solid_angles(height, 2 * height), np.float64).ravel()
    ours = _ours(frame, axes, height).ravel() * area
    plain = _plain_ewa(np.radians(latitude), axes, height).ravel() * area
    cut = 1 - ALPHA_CUT / OPACITY * (1 + np.log(OPACITY / ALPHA_CUT))  # second moment of a Gaussian up to the cut
    share = cut / (1 - ALPHA_CUT / OPACITY)
    truth = _moments(truth_rays, np.ones(SAMPLES), frame) * share
    return {
        "latitude": latitude,
        "sigma": sigma,
        "ours": _error(_moments(rays, ours, frame), truth),
        "plain_ewa": _error(_moments(rays, plain, frame), truth) if plain.sum() > 0 else float("inf"),
    }


def _ours(frame, axes, height):
    """Rendered alpha (height, 2 height)."""
    rotation = np.stack([frame[1], frame[2], frame[0]], axis=1)
    rotation[:, 2] *= np.sign(np.linalg.det(rotation))
    scene = Gaussians(
        jnp.asarray(frame[:1], jnp.float32),
        jnp.log(jnp.asarray(axes[None], jnp.float32)),
        jnp.asarray(quats_from_matrix(rotation)[None], jnp.float32),
        jnp.full(1, np.log(OPACITY / (1 - OPACITY)), jnp.float32),
        jnp.zeros((1, 1, 3)),
        jnp.ones(1, bool),
    )
    camera = equirectangular_camera(upright(jnp.zeros(3)), height)
    frame, _ = render(scene, camera, config=RasterizeConfig(antialias=False, distance=False))
    return np.asarray(frame.alpha, np.float64)


def _plain_ewa(latitude, axes, height):
    """Alpha of the affine approximation: a pixel is pi / height in latitude, 1 / cos(latitude) less in longitude."""
    pitch = np.pi / height
    v, u = np.mgrid[:height, : 2 * height] + 0.5
    du = u - (AZIMUTH / (2 * np.pi) + 0.5) * 2 * height
    du = (du + height) % (2 * height) - height  # the nearest way round
    dv = v - (0.5 - latitude / np.pi) * height
    variance_u = (axes[0] / np.cos(latitude) / pitch) ** 2
    variance_v = (axes[1] / pitch) ** 2
    alpha = OPACITY * np.exp(-0.5 * (du**2 / variance_u + dv**2 / variance_v))
    return np.where(alpha < ALPHA_CUT, 0.0, alpha)


def _chart(rows, path):
    from matplotlib.figure import Figure  # of the bench extra; the numbers need none

    figure = Figure(figsize=(9, 3.6), layout="constrained")
    titles = {"ours": "on the Gaussian's tangent plane (ours)", "plain_ewa": "plain EWA"}
    for axis, (key, title) in zip(figure.subplots(1, 2), titles.items(), strict=True):
        grid = np.array([[r[key] for r in rows if r["latitude"] == latitude] for latitude in LATITUDES])
        picture = axis.imshow(np.log10(np.maximum(grid, 1e-3)), vmin=-3, vmax=0.5, cmap="magma_r", aspect="auto")
        for i, line in enumerate(grid):
            for j, value in enumerate(line):
                axis.text(j, i, f"{value:.1%}", ha="center", va="center", fontsize=7, color="0.5")
        axis.set(title=title, xlabel="sigma / distance", ylabel="latitude, degrees")
        axis.set_xticks(range(len(SIGMAS)), SIGMAS)
        axis.set_yticks(range(len(LATITUDES)), LATITUDES)
    figure.colorbar(picture, label="log10 of the error of second moments")
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    write_bytes(Path(path), buffer.getvalue())


def main(arguments: list[str] | None = None) -> int:
    """Prints the errors by latitude and size."""
    parser = CommandParser("poles", __doc__, "benchmarks")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    parser.add_argument("--chart", metavar="PNG", help="draw the errors there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    rows = [footprint_errors(latitude, sigma) for latitude in LATITUDES for sigma in SIGMAS]
    for key in ("ours", "plain_ewa"):
        print(f"{key}: error of second moments, by sigma / distance {SIGMAS}")
        for latitude in LATITUDES:
            print(f"{latitude:6}", *(f"{row[key]:8.1%}" for row in rows if row["latitude"] == latitude))
    if options.json:
        write_text(Path(options.json), json.dumps(rows, indent=1) + "\n")
    if options.chart:
        _chart(rows, options.chart)


if __name__ == "__main__":
    sys.exit(main())
