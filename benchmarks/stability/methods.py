"""What is compared: our chain, and the peers that users have instead. Each makes a `Renderer` of a panorama.

ours    the draft recipe: lifted along surfaces, the room behind things made up; nothing refined
balls   the paper's lift: a ball a pixel of the pixel's colour, 3DGS' filter
mesh    the panorama's mesh, cut where the distance jumps
telea   our lift alone, its holes inpainted by OpenCV in each view
box     the room as a plain box that wears the panorama
"""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np

from experiments.config import load_config
from experiments.evaluate.mesh_warp import mesh_warp
from experiments.evaluate.renderer import Renderer, Rendering
from experiments.evaluate.room import whole
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.geometry.resample import sample_sphere
from rein3d_jax.geometry.safe import safe_divide
from rein3d_jax.geometry.shell import meet_shell
from rein3d_jax.geometry.sphere import pixels_from_rays, rays_of_pose
from rein3d_jax.lift import LiftConfig, compact, lift
from rein3d_jax.networks.trained import read_network
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.pipeline.survey import Survey, lift_scene, room_background, with_distance
from rein3d_jax.rasterize import ADDED, Buffers, RasterizeConfig, bucket, render
from rein3d_jax.restore import Background, Restorer, TrainedNetwork, restorer
from rein3d_jax.restore.fills import restore_telea
from rein3d_jax.scene import Camera, Gaussians, Panorama, Video

SMALL_DRAFT = ("restore.height=64", "lift.share=1.0")
BALLS = LiftConfig(
    footprint=1.0, plain_footprint=1.0, sharpen=0.0, steepest=0.0, thickness=1.0, snap_edges=False
)  # fmt: skip
CLASSIC = RasterizeConfig(antialias=False, filter=ADDED, filter_variance=0.3)  # 3DGS
# By capacity: the same for all scenes, so that the rasterizer compiles once.
_BUFFERS: dict[tuple, Buffers] = {}


@cache
def stages() -> ReconstructConfig:
    """The draft recipe at the atlas' size."""
    return load_config(ReconstructConfig, "draft", list(SMALL_DRAFT))


def small_restorer(background: Background | None) -> Restorer:
    """The draft recipe's, the packaged network."""
    return restorer(stages().restore, background, _network())


@cache
def _network() -> TrainedNetwork | None:
    return read_network(stages().restore)


def completed(panorama: Panorama) -> Panorama:
    """With a distance everywhere, as the main job has it."""
    return with_distance(panorama, stages())[0]


def splats(gaussians: Gaussians, raster: RasterizeConfig = RasterizeConfig()) -> Renderer:
    """A scene as the rasterizer shows it, in a buffer of rounded size."""
    scene = compact(gaussians, capacity=_roomy(int(gaussians.alive.sum())))

    def renderer(camera: Camera) -> Rendering:
        key = (scene.alive.size, camera.model, camera.height, camera.width, raster)
        start = _BUFFERS.get(key) or Buffers(*(bucket(int(x * scene.alive.size)) for x in (1.0, 2.0, 4.0, 0.3)))
        frame, _BUFFERS[key] = render(scene, camera, config=raster, buffers=start)
        return Rendering(jnp.clip(safe_divide(frame.rgb, frame.alpha[..., None]), 0, 1), frame.alpha, frame.distance)

    return renderer


def _roomy(count: int) -> int:
    """The next power of 2 that holds `count`: few programs."""
    return 1 << max(count - 1, 1023).bit_length()


def ours(panorama: Panorama) -> Renderer:
    """Lifted, and peeled."""
    return splats(peeled(panorama))


def ours_by_background(panorama: Panorama) -> Renderer:
    """The same, what is hidden filled without a network."""
    return splats(peeled(panorama, "background"))


def peeled(panorama: Panorama, fill: str | None = None) -> Gaussians:
    """The scene of the draft recipe, or with another `fill` than its restorer's."""
    config, placed = stages(), completed(panorama)
    background = room_background(placed, config.restore)
    named = replace(config.restore, method=fill or config.restore.method)
    restore = restorer(named, background, _network())
    paths = radial_trajectories(placed, config=config.explore)
    known = Survey(placed, lift_scene(placed, config.lift), paths)
    return peel_scene(known, background, restore, jax.random.key(0), stages=config)


def balls(panorama: Panorama) -> Renderer:
    """The paper's lift."""
    return splats(lifted_by(panorama, BALLS), CLASSIC)


def mesh(panorama: Panorama) -> Renderer:
    """The mesh with cut edges."""
    return mesh_warp(whole(completed(panorama)))


def telea(panorama: Panorama) -> Renderer:
    """Our lift, each view's holes inpainted."""
    base = splats(lifted_by(panorama, stages().lift))

    def renderer(camera: Camera) -> Rendering:
        seen = base(camera)
        frames = (np.asarray(x)[None] for x in (*seen, camera.world_from_camera))  # in jax each mask would compile
        filled = restore_telea(Video(*frames), observed=0.5)
        return Rendering(filled.rgb[0], jnp.where(seen.alpha < 0.5, 1.0, seen.alpha), filled.distance[0])

    return renderer


def box(panorama: Panorama) -> Renderer:
    """The room's shell, wearing the panorama."""
    placed = completed(panorama)
    shell, _ = shell_from_distance(placed)
    return lambda camera: _boxed(placed.rgb, shell, camera)


@jax.jit
def _boxed(rgb, shell, camera: Camera) -> Rendering:
    pose = camera.world_from_camera
    rays = rays_of_pose(pose, camera.height, camera.width)
    distance, _ = meet_shell(shell, pose[:3, 3], rays)
    colour = sample_sphere(rgb, *pixels_from_rays(pose[:3, 3] + distance[..., None] * rays, *rgb.shape[:2]))
    return Rendering(colour, jnp.ones(distance.shape), distance)


def lifted_by(panorama: Panorama, config: LiftConfig) -> Gaussians:
    """A Gaussian a pixel."""
    placed = whole(completed(panorama))
    return lift(placed, origin_pose(), placed.valid, config=replace(config, share=1.0))


METHODS: dict[str, Callable[[Panorama], Renderer]] = {
    "ours": ours, "balls": balls, "mesh": mesh, "telea": telea, "box": box,
}  # fmt: skip
