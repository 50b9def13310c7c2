"""viewer.html of a finished run."""

import numpy as np

from experiments.reconstruct.run import Run
from experiments.reconstruct.run_report import room_plan
from rein3d_jax.io.pictures.image import encode_jpeg
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.report.viewer import render_viewer


def viewer_page(run: Run) -> str:
    """The input panorama, and both scenes as they come back from SPZ. Raises InputError where SPZ cannot hold one."""
    result, config = run.result, run.config
    scenes = {
        "Coarse": encode_spz(result.coarse, "the lifted scene"),
        "Refined": encode_spz(result.scene, "the refined scene"),
    }
    panorama = encode_jpeg(np.asarray(result.panorama.rgb))
    plan, variance = room_plan(result.trajectories, config.explore, run.views), config.rasterize.filter_variance
    return render_viewer(scenes, panorama, plan, backdrop=np.asarray(run.backdrop), filter_variance=variance)
