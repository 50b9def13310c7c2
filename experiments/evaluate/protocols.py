"""The paper's protocols, each a function of a method and a room that gives figures (see measure.py)."""

import dataclasses
from collections.abc import Mapping, Sequence
from functools import lru_cache, partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.evaluate.held_out import HeldOutPicture, held_out_pictures
from experiments.evaluate.measure import Figures, distance_figures, picture_figures, sphere_figures
from experiments.evaluate.mesh_warp import mesh_warp
from experiments.evaluate.methods import COARSE, MESH, OF_CLIPS, OF_SCENES, Built, build, fill_of
from experiments.evaluate.renderer import Rendering, first_of_each_kind
from experiments.evaluate.room import EvaluationRoom, timed, whole
from rein3d_jax.errors import InputError
from rein3d_jax.evaluate.clip_features import ClipFeatures
from rein3d_jax.evaluate.coverage import coverage
from rein3d_jax.evaluate.flicker import flicker
from rein3d_jax.evaluate.no_reference.brisque import brisque
from rein3d_jax.evaluate.no_reference.niqe import niqe
from rein3d_jax.evaluate.regions import DISOCCLUDED, NEVER_SEEN, OBSERVED, regions_of_view
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.explore.viewpoints import evaluation_viewpoints
from rein3d_jax.geometry.poses import equirectangular_camera, pinhole_camera
from rein3d_jax.geometry.sphere import rays_of_pose
from rein3d_jax.scene import Camera

REGIONS = {"observed": OBSERVED, "disoccluded": DISOCCLUDED, "never_seen": NEVER_SEEN}
VIEW, VIEW_FOV = 192, np.pi / 2  # pixels and radians of views without a reference: four of NIQE's blocks


@dataclasses.dataclass(frozen=True)
class Tools:
    """Weights and a folder: what the figures need besides the room."""

    lpips: Mapping
    niqe: Mapping
    brisque: Mapping
    features: ClipFeatures  # of the Frechet distance
    feature_weights: Mapping
    runs: Path  # where the main job keeps its results


@dataclasses.dataclass(frozen=True)
class Outcome:
    """A method's figures in one room, and for clips the features of what it shows and of the truth."""

    figures: Figures
    features: tuple[list[float], list[float]] | None = None


def restoration(method: str, room: EvaluationRoom, tools: Tools) -> Outcome:
    """Figures of the room's video, restored from what its first frame, lifted, shows along the path. The first frame
    itself has no holes and does not count. The videos have no true distance: what the lifted frame leaves open counts
    as disoccluded, what it shows at a completed distance as never seen, the rest as observed."""
    truth, needed = room.clip_rgb, tools.features.frames
    if len(truth) < needed:
        raise InputError(f"{room.name}: {tools.features.label} needs clips of {needed} frames, not {len(truth)}")
    (degraded, _), (shown, seconds) = room.degraded, _clip(method, room)
    hole = degraded.alpha < room.config.restore.observed
    masks = {name: mask[1:] for name, mask in _masks(_clip_regions(room, hole), hole).items()}
    metres = np.linalg.norm(degraded.world_from_camera[1:, :3, 3], axis=-1)
    figures = picture_figures(shown[1:], truth[1:], masks, metres, tools.lpips)
    figures |= sphere_figures(shown[1:], truth[1:], masks, metres)
    figures |= {"flicker": float(flicker(shown)), "flicker_truth": float(flicker(truth)), "seconds": seconds}
    both = [tools.features.of_clip(tools.feature_weights, clip).tolist() for clip in (shown, truth)]
    return Outcome(figures, tuple(both))


def novel_views(method: str, room: EvaluationRoom, tools: Tools) -> Outcome:
    """Figures of the room's held-out views and panoramas. Views give psnr, ssim, lpips; panoramas ws_psnr, ws_ssim,
    seam, the errors of distance, and coverage. Views from the input's own place are apart (`*_origin`)."""
    held_out = held_out_pictures(room)
    built, shown, seconds = _render_all(method, room, [picture.camera for picture in held_out], tools)
    figures = {"seconds": seconds, "seconds_per_view": (seconds - built.seconds) / len(held_out), **built.size}
    backdrop, holes = room.backdrop, _holes(room)
    for kind, of in (("origin", _of_origin), ("view", _of_views), ("panorama", _of_panoramas)):
        index = [i for i, picture in enumerate(held_out) if picture.kind == kind]
        if index:
            chosen = [held_out[i] for i in index]
            pictures = jnp.stack([shown[i].over(backdrop) for i in index])
            masks = _masks(jnp.stack([t.region for t in chosen]), jnp.stack([holes[i] for i in index]))
            figures |= of(pictures, [shown[i] for i in index], chosen, masks, tools)
    return Outcome(figures)


def no_reference(method: str, room: EvaluationRoom, tools: Tools) -> Outcome:
    """Figures niqe and brisque of views at the paper's five viewpoints by four yaws (Algorithm 2), and the coverage of
    panoramas there."""
    config = room.config
    safe = radial_trajectories(room.panorama, config=config.explore).safe
    points = evaluation_viewpoints(jax.random.key(config.seed), safe, config=config.explore)
    poses = points.world_from_camera[points.valid]
    views = [pinhole_camera(pose, VIEW, VIEW_FOV) for pose in poses.reshape(-1, 4, 4)]
    around = [equirectangular_camera(pose, config.restore.height) for pose in poses[:, 0]]
    built, shown, seconds = _render_all(method, room, [*views, *around], tools)
    pictures = jnp.stack([one.over(room.backdrop) for one in shown[: len(views)]])
    seen = jnp.stack([one.alpha for one in shown[len(views) :]])
    figures = {"niqe": niqe(tools.niqe, pictures), "brisque": brisque(tools.brisque, pictures)}
    figures = {name: float(jnp.nanmean(values)) for name, values in figures.items()}
    return Outcome(figures | {"coverage": float(coverage(seen).mean()), "seconds": seconds, **built.size})


NO_TRUTH = "no_reference"  # the one that needs no ground truth
PROTOCOLS = {
    "restoration": (restoration, OF_CLIPS),
    "novel_views": (novel_views, OF_SCENES),
    NO_TRUTH: (no_reference, OF_SCENES),
}


def _clip(method: str, room: EvaluationRoom) -> tuple[jax.Array, float]:
    """(t, h, w, 3) and the seconds from the panorama in memory."""
    degraded, seconds = room.degraded
    if method == COARSE:
        return Rendering(degraded.rgb, degraded.alpha, degraded.distance).over(room.backdrop), seconds
    if method == MESH:
        cameras = [equirectangular_camera(pose, degraded.rgb.shape[1]) for pose in degraded.world_from_camera]

        def warp():
            mesh = mesh_warp(whole(room.clip_input))
            return jnp.stack([mesh(camera).over(room.backdrop) for camera in cameras])

        return timed(warp)
    fill, ahead = fill_of(method, room)
    restored, spent = timed(lambda: fill(degraded, jax.random.key(room.config.seed)))
    return jnp.clip(restored.rgb, 0, 1), seconds + ahead + spent


def _clip_regions(room: EvaluationRoom, hole: jax.Array) -> jax.Array:
    """(t, h, w) by what the lifted frame shows where: its completed distances are none that the input knew."""
    video = room.degraded[0]
    poses = video.world_from_camera
    rays = jax.vmap(lambda pose: rays_of_pose(pose, *hole.shape[1:]))(poses)
    region_of = jax.vmap(partial(regions_of_view, room.clip_input))
    known = region_of(poses[:, :3, 3], rays, jnp.where(hole, 0.0, video.distance))
    return jnp.where(hole, DISOCCLUDED, jnp.where(known == NEVER_SEEN, NEVER_SEEN, OBSERVED))


def _render_all(
    method: str, room: EvaluationRoom, cameras: Sequence[Camera], tools: Tools
) -> tuple[Built, list[Rendering], float]:
    """The renderings for `cameras`, and the seconds from the panorama in memory to all of them."""
    built = build(method, room, cameras, tools.runs)
    jax.block_until_ready([built.render(camera) for camera in first_of_each_kind(cameras)])  # compiles
    shown, seconds = timed(lambda: [built.render(camera) for camera in cameras], again=False)
    return built, shown, built.seconds + seconds


@lru_cache(maxsize=1)  # every method of a room asks for them
def _holes(room: EvaluationRoom) -> list[jax.Array]:
    """(h, w) bool for each held-out picture: the lifted scene leaves it open."""
    cameras = [picture.camera for picture in held_out_pictures(room)]
    render = build(COARSE, room, cameras, Path()).render
    return [render(camera).alpha < room.config.restore.observed for camera in cameras]


def _masks(region: jax.Array, hole: jax.Array) -> dict[str, jax.Array]:
    return {name: region == code for name, code in REGIONS.items()} | {"hole": hole}


def _of_origin(pictures, shown, chosen: Sequence[HeldOutPicture], masks, tools: Tools) -> Figures:
    truth = jnp.stack([picture.rgb for picture in chosen])
    figures = picture_figures(pictures, truth, {}, np.zeros(len(chosen)), tools.lpips)
    return {f"{name}_origin": figures[name] for name in ("psnr", "ssim", "lpips")}


def _of_views(pictures, shown, chosen: Sequence[HeldOutPicture], masks, tools: Tools) -> Figures:
    truth = jnp.stack([picture.rgb for picture in chosen])
    return picture_figures(pictures, truth, masks, np.array([t.metres for t in chosen]), tools.lpips)


def _of_panoramas(pictures, shown, chosen: Sequence[HeldOutPicture], masks, tools: Tools) -> Figures:
    truth, metres = jnp.stack([picture.rgb for picture in chosen]), np.array([t.metres for t in chosen])
    true_distance = jnp.stack([picture.distance for picture in chosen])
    figures = sphere_figures(pictures, truth, masks, metres)
    figures |= distance_figures(jnp.stack([one.distance for one in shown]), true_distance, masks, metres)
    return figures | {"coverage": float(coverage(jnp.stack([one.alpha for one in shown])).mean())}
