"""Scenes that engines are measured on: a furnished room's surfaces as splats."""

import dataclasses

import numpy as np

ROOM = np.array([4.0, 3.0, 5.0])  # metres: right, down, ahead
BOXES = 5
FOV = np.radians(70)
JITTER = 0.004  # metres


@dataclasses.dataclass(frozen=True)
class Size:
    """Number of Gaussians, their scale in metres, and the picture."""

    count: int
    scale: float
    width: int
    height: int


SIZES = {
    "A": Size(100_000, 0.015, 640, 480),
    "B": Size(400_000, 0.008, 640, 480),
    "C": Size(20_000, 0.04, 256, 256),
}


@dataclasses.dataclass(frozen=True)
class Workload:
    """Splats in the axes of a camera at the origin that looks along +z (OpenCV), and a target picture."""

    size: Size
    means: np.ndarray  # (n, 3) metres
    scales: np.ndarray  # (n, 3) metres
    quats: np.ndarray  # (n, 4) wxyz, unit
    opacities: np.ndarray  # (n,)
    colours: np.ndarray  # (n, 3) in [0, 1]
    target: np.ndarray  # (h, w, 3)

    @property
    def focal(self) -> float:
        """Pixels."""
        return self.size.width / 2 / np.tan(FOV / 2)


def make_workload(size: Size, seed: int = 0) -> Workload:
    """Room shell and five boxes, points uniform by area with 4 mm of jitter, scales lognormal(0.4) with 0.1 of
    anisotropy, any rotation, opacity U(0.3, 0.95)."""
    rng = np.random.default_rng(seed)
    n = size.count
    means = _surface_points(n, rng) + rng.normal(0, JITTER, (n, 3))
    scales = size.scale * np.exp(rng.normal(0, 0.4, (n, 1)) + rng.normal(0, 0.1, (n, 3)))
    quats = rng.normal(size=(n, 4))
    quats /= np.linalg.norm(quats, axis=1, keepdims=True)
    opacities, colours = rng.uniform(0.3, 0.95, n), rng.random((n, 3))
    leaves = [x.astype(np.float32) for x in (means, scales, quats, opacities, colours)]
    return Workload(size, *leaves, rng.random((size.height, size.width, 3)).astype(np.float32))


def _surface_points(count: int, rng: np.random.Generator) -> np.ndarray:
    centres, sizes = [np.zeros(3)], [ROOM]
    while len(centres) <= BOXES:
        size = rng.uniform(0.4, 1.0, 3)
        centre = rng.uniform(-0.5, 0.5, 3) * (ROOM - size)
        if np.linalg.norm(centre) > 1.0:  # clear of the camera
            centres.append(centre)
            sizes.append(size)
    centres, sizes = np.array(centres), np.array(sizes)
    areas = np.stack([sizes[:, (axis + 1) % 3] * sizes[:, (axis + 2) % 3] for axis in range(3)], axis=1)
    box, axis = np.divmod(rng.choice(areas.size, count, p=(areas / areas.sum()).ravel()), 3)
    points = centres[box] + (rng.random((count, 3)) - 0.5) * sizes[box]
    rows = np.arange(count)
    points[rows, axis] = centres[box, axis] + rng.choice([-0.5, 0.5], count) * sizes[box, axis]
    return points
