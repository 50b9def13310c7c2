"""What a finished run's folder holds, read back: its recipe, its scene and its stages."""

import dataclasses
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from experiments.config import load_config, recipe_digest
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.stage_store import UNFINISHED, blank_stages, read_stage
from rein3d_jax.errors import InputError
from rein3d_jax.explore.trajectories import Trajectories
from rein3d_jax.io.files.json_file import read_json
from rein3d_jax.io.files.npy import read_arrays, read_headers
from rein3d_jax.io.splats.ply import read_ply
from rein3d_jax.scene import Gaussians, Panorama, Video


@dataclasses.dataclass(frozen=True)
class RunFolder:
    """A folder that `reconstruct` wrote. Parts are read when they are asked for; each raises InputError, naming the
    file, where it is missing or damaged."""

    path: Path
    config: ReconstructConfig

    @cached_property
    def panorama(self) -> Panorama:
        """The input at the working height, its distance complete."""
        found = self._stage("read")[0]
        return self._sound("read", found, _is_panorama(found.rgb.shape, found.distance.shape, found.valid.shape))

    @cached_property
    def trajectories(self) -> Trajectories:
        """Where the camera went."""
        found = self._stage("explore")
        paths, frames = found.positions.shape[:2] if found.positions.ndim == 3 else (0, 0)
        shaped = found.counts.shape == (paths,) and found.world_from_camera.shape == (paths, frames, 4, 4)
        within = bool(jnp.all((found.counts >= 1) & (found.counts <= frames)))
        return self._sound("explore", found, paths > 0 and shaped and within)

    @cached_property
    def coarse(self) -> Gaussians:
        """The lifted panorama."""
        return self._stage("lift")

    @cached_property
    def refined(self) -> Gaussians:
        """scene.ply."""
        return read_ply(self.path / "scene.ply")

    @property
    def backdrop(self) -> jnp.ndarray:
        """(3,) sRGB of what no splat covers, as the run's own pictures have it."""
        return jnp.mean(self.panorama.rgb, axis=(0, 1))

    @property
    def unfinished(self) -> Gaussians:
        """The scene at refinement's last held-out evaluation."""
        return self._stage(UNFINISHED).scene

    @property
    def finished(self) -> bool:
        """Whether a job of this very recipe came to its end."""
        if not (self.path / "metrics.json").exists():
            return False
        digest = recipe_digest(self.path / "config.toml")
        metrics = read_json(self.path / "metrics.json")
        return isinstance(metrics, dict) and metrics.get("recipe", digest) == digest

    def progress(self) -> Iterator[tuple[str, str]]:
        """(stage, what became of it), in the order in which they are made."""
        begun = (self.path / "config.toml").stat().st_mtime_ns
        restores = (f"restore-{index:02d}" for index in range(self.config.explore.trajectories))
        for name in ("read", "lift", "explore", "peel", *restores, "refine"):
            file = self.path / "stages" / f"{name}.npz"
            state = "waiting"
            if file.exists():
                state = "done" if file.stat().st_mtime_ns >= begun else "done by an earlier job"
            yield name, state

    def curves(self, names: Iterable[str]) -> dict[str, np.ndarray]:
        """The curves (k, 2) of (step, value) that refinement has drawn so far."""
        names = list(names)
        keys = [f"['result'].curves.{name}" for name in names]
        path = self.path / "stages" / f"{UNFINISHED}.npz"
        headers = read_headers(path)
        if not all(key in headers and headers[key].shape[1:] == (2,) for key in keys):
            raise InputError(f"{path} has no curves: it is damaged, or of another version")
        return dict(zip(names, read_arrays(path, keys), strict=True))

    def videos(self) -> Iterator[Video]:
        """The restored panoramas along each trajectory, one after another."""
        for index in range(self.config.explore.trajectories):
            name = f"restore-{index:02d}"
            found = self._stage(name).video
            posed = found.world_from_camera.shape == (len(found.rgb), 4, 4)
            shapes = (found.rgb.shape[1:], found.distance.shape[1:], found.alpha.shape[1:])
            yield self._sound(name, found, posed and _is_panorama(*shapes))

    def _stage(self, name: str) -> Any:
        return read_stage(self.path / "stages" / f"{name}.npz", blank_stages(self.config.refine)[name.split("-")[0]])

    def _sound(self, name: str, found: Any, shaped: bool) -> Any:
        finite = all(bool(jnp.all(jnp.isfinite(leaf))) for leaf in jax.tree.leaves(found))
        if not (shaped and finite):
            fault = "values that are not finite" if shaped else "arrays that do not fit each other"
            raise InputError(f"{self.path / 'stages' / name}.npz holds {fault}: remove it and run that stage again")
        return found


def _is_panorama(rgb: tuple[int, ...], *maps: tuple[int, ...]) -> bool:
    height = rgb[0] if len(rgb) == 3 else 0
    return height > 0 and rgb == (height, 2 * height, 3) and all(shape == rgb[:2] for shape in maps)


def open_run(path: str | Path) -> RunFolder:
    """The run in the folder `path`. Raises InputError if it is none, or its recipe is of another version."""
    path = Path(path)
    if not (path / "config.toml").is_file():
        raise InputError(f"{path} is no run's folder (it has no config.toml): give the --output of reconstruct")
    return RunFolder(path, load_config(ReconstructConfig, path / "config.toml"))
