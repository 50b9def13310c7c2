"""The film: out and back along every trajectory, once round, yawing at the panorama's centre."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.geometry.poses import pinhole_camera, upright
from rein3d_jax.rasterize import RasterizeConfig, allocate, render
from rein3d_jax.scene import Camera, Gaussians
from rein3d_jax.settings import Settings, setting


@dataclasses.dataclass(frozen=True)
class FilmConfig(Settings):
    """The film's size and pace."""

    width: int = setting(480, "of a frame", within="[16, 8192]", unit="pixels")
    height: int = setting(270, "of a frame", within="[16, 8192]", unit="pixels")
    fov: float = setting(1.5, "across the width", within="(0, 3]", unit="radians")
    step: float = setting(0.2, "between frames on a path", within="(0, inf)", unit="metres")
    yaw_step: float = setting(0.1, "between frames on the way to the next path", within="(0, inf)", unit="radians")
    rate: int = setting(15, "of the film", within="[1, 240]", unit="frames a second")


def _camera(position, yaw, film: FilmConfig) -> Camera:
    return pinhole_camera(upright(position, yaw), (film.height, film.width), film.fov)


def flythrough(
    gaussians: Gaussians, trajectories: Trajectories, backdrop, *, film: FilmConfig, config: RasterizeConfig
) -> Iterator:
    """Yields (height, width, 3) pictures. The way back shows the way out again, backwards: it is rendered once."""
    # Trajectories come longest first; one beside the other, there is one turn to show between them, not five.
    round_way = np.argsort(np.asarray(trajectories.directions) % (2 * np.pi), kind="stable")
    azimuths, lengths = (np.asarray(x)[round_way] for x in (trajectories.directions, trajectories.lengths))
    ends = [_camera(np.zeros(3), -azimuth, film) for azimuth in azimuths]
    buffers = allocate(gaussians, ends, config=config, slack=1.5)

    def picture(camera):
        nonlocal buffers
        frame, buffers = render(gaussians, camera, config=config, buffers=buffers)
        return np.asarray(frame.over(backdrop))

    for index, (azimuth, length) in enumerate(zip(azimuths, lengths, strict=True)):
        heading = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
        out = [picture(_camera(heading * s, -azimuth, film)) for s in np.arange(0.0, length + 1e-6, film.step)]
        yield from out
        yield from out[-2::-1]
        following = azimuths[(index + 1) % len(azimuths)]
        between = (following - azimuth) % (2 * np.pi)
        for angle in np.arange(film.yaw_step, between, film.yaw_step):
            yield picture(_camera(np.zeros(3), -(azimuth + angle), film))
