"""viewer.html of a run: of a size that browsers load, whatever the scene's; scene.ply beside it is whole."""

import numpy as np

from experiments.reconstruct.pages.run_report import room_plan
from experiments.reconstruct.run import Run
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.lift.detail_order import lighter_scene
from rein3d_jax.report.viewer import render_viewer

_LARGEST = 16_000_000  # bytes of SPZ and JPEG: 21.3 MB of text in the page, beside 3.1 MB of code
_LEFT = 0.7  # of a proportional share: what is left of a scene is packed less tightly


def viewer_page(run: Run) -> str:
    """The input panorama, and the run's scenes as they come back from SPZ; the last one alone where both are too large,
    and a lighter one where it is too large alone. Raises InputError where SPZ cannot hold one."""
    result, config = run.result, run.config
    panorama = encode_jpeg(np.asarray(result.panorama.rgb))
    largest = _LARGEST - len(panorama)
    scenes = {"Coarse": encode_spz(result.coarse, "the lifted scene")}
    if run.finished:
        scenes["Refined"] = encode_spz(result.scene, "the refined scene")
    if sum(map(len, scenes.values())) > largest:
        name, last = scenes.popitem()
        scene = result.scene if run.finished else result.coarse
        if len(last) > largest:
            count = int(_LEFT * largest / len(last) * int(scene.alive.sum()))
            last = encode_spz(lighter_scene(scene, count), "the scene")
        scenes = {name: last}
    plan, raster = room_plan(result.trajectories, config.explore, run.views), config.rasterize
    seen_by = (raster.filter, raster.filter_variance)
    return render_viewer(scenes, panorama, plan, backdrop=np.asarray(run.backdrop), pixel_filter=seen_by)
