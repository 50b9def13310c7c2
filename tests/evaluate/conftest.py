"""A room with a box in it, traced in float64 NumPy: what distances, views and regions are compared with; and
photographs, for the statistics of natural pictures."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from skimage.data import astronaut, chelsea

ROOM = np.array([3.0, 2.5, 1.4])  # half sizes, metres; the world's origin is its middle
BOX = np.array([[1.0, -0.6, -1.4], [1.6, 0.5, 0.2]])  # two opposite corners; it stands on the floor


class BoxRoom:
    """All of it is seen from the origin but what the box hides, and the box's far side."""

    @staticmethod
    def rays(height, width):
        """(height, width, 3) unit rays of an unturned panorama, as conventions.py says."""
        azimuth = ((np.arange(width) + 0.5) / width - 0.5) * 2 * np.pi
        latitude = ((0.5 - (np.arange(height) + 0.5) / height) * np.pi)[:, None]
        parts = (np.cos(azimuth) * np.cos(latitude), -np.sin(azimuth) * np.cos(latitude), np.sin(latitude))
        return np.stack(np.broadcast_arrays(*parts), axis=-1)

    @staticmethod
    def distance(origin, rays):
        """(h, w) metres to the first surface from `origin` (3,), a place in the room outside the box."""
        entry, leave = _span(origin, rays)
        walls = ((np.sign(rays) * ROOM - origin) / rays).min(axis=-1)
        return np.where((entry > 0) & (entry < leave), entry, walls)

    @staticmethod
    def hidden(points):
        """Whether the box stands between the world's origin and `points` (h, w, 3), its own far sides included."""
        entry, leave = _span(np.zeros(3), points)
        return (entry < leave) & (entry > 0) & (entry < 1 - 1e-6)

    @staticmethod
    def colour(points):
        """(..., 3): smooth waves of two metres and more on all surfaces, within [0, 1]."""
        phases = points @ np.array([[2.0, 0.5, 1.2], [-1.0, 2.5, 0.5], [1.5, -0.5, 3.0]]).T
        return 0.5 + 0.4 * np.sin(phases)


def _span(origin, rays):
    """Where rays enter and leave the box, in units of their length; entry > leave where they miss it."""
    crossings = (BOX[:, None, None] - origin) / rays
    return crossings.min(axis=0).max(axis=-1), crossings.max(axis=0).min(axis=-1)


@pytest.fixture(scope="session")
def box_room():
    return BoxRoom


@pytest.fixture(scope="session")
def photos():
    """(picture, treatment) -> (h, w, 3) float32 in [0, 1] of 8-bit values: a view and a panorama's size, as they are,
    with noise, and blurred. The golden values of tests were taken from published packages on these very pictures."""

    def treated(photo):
        noise = np.random.default_rng(0).normal(0, 20, photo.shape)
        blurred = gaussian_filter(photo.astype(np.float64), (1.5, 1.5, 0))
        return {"clean": photo, "noisy": np.clip(np.round(photo + noise), 0, 255), "blurred": np.round(blurred)}

    crops = {"view": astronaut()[:192, 128:320], "panorama": chelsea()[50:178, 100:356]}
    return {
        (name, treatment): (picture / 255).astype(np.float32)
        for name, crop in crops.items()
        for treatment, picture in treated(crop).items()
    }
