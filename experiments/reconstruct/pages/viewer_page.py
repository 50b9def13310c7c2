"""viewer.html of a run: of a size that browsers load, whatever the scene's; scene.ply beside it is whole."""

import numpy as np

from experiments.reconstruct.pages.run_report import room_plan
from experiments.reconstruct.run import Run
from rein3d_jax.explore.trajectories import path_ends
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.pipeline.stages import origin_pose
from rein3d_jax.refine.prune import contribution, prune_to
from rein3d_jax.report.viewer import render_viewer
from rein3d_jax.scene import Gaussians

_LARGEST = 15_000_000  # bytes of SPZ: 20 MB of text in the page, beside 4 MB of code and panorama
_LEFT = 0.8  # of a proportional share: what is left of a scene is packed less tightly


def viewer_page(run: Run) -> str:
    """The input panorama, and the run's scenes as they come back from SPZ; the last one alone where both are too large,
    and what adds most to it where it is too large alone. Raises InputError where SPZ cannot hold one."""
    result, config = run.result, run.config
    scenes = {"Coarse": encode_spz(result.coarse, "the lifted scene")}
    if run.finished:
        scenes["Refined"] = encode_spz(result.scene, "the refined scene")
    if sum(map(len, scenes.values())) > _LARGEST:
        name, last = scenes.popitem()
        scene = result.scene if run.finished else result.coarse
        if len(last) > _LARGEST:
            last = encode_spz(_what_adds_most(run, scene, _LEFT * _LARGEST / len(last)), "the scene")
        scenes = {name: last}
    panorama = encode_jpeg(np.asarray(result.panorama.rgb))
    plan, variance = room_plan(result.trajectories, config.explore, run.views), config.rasterize.filter_variance
    return render_viewer(scenes, panorama, plan, backdrop=np.asarray(run.backdrop), filter_variance=variance)


def _what_adds_most(run: Run, scene: Gaussians, share: float) -> Gaussians:
    """A share of the scene: what adds most to panoramas from the origin and from the ends of the paths."""
    rows = len(run.result.panorama.rgb)
    poses = (origin_pose(), *path_ends(run.result.trajectories))
    cameras = [equirectangular_camera(pose, rows) for pose in poses]
    weight = contribution(scene, cameras, config=run.config.rasterize)
    return prune_to(scene, weight, int(share * int(scene.alive.sum())))
