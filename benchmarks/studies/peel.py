"""What the layers behind a panorama bring: rooms lifted, then with each layer, before any path is taken.

PSNR and LPIPS at novel views; PSNR over all pixels that the input observed, that something hid, that were never seen;
Gaussians; and the seconds that the layers took, the first time compiled before. Means over rooms, with standard errors.

    python -m benchmarks.studies.peel --rooms FOLDER --json benchmarks/results/peel.json
"""

import sys
from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter

import jax

from benchmarks.studies.room_table import StudiedRoom, run_study
from experiments.evaluate.room import EvaluationRoom
from experiments.reconstruct.config import ReconstructConfig
from rein3d_jax.evaluate.regions import DISOCCLUDED, NEVER_SEEN, OBSERVED
from rein3d_jax.networks.trained import read_network
from rein3d_jax.peel import PeelConfig
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.survey import room_background, survey
from rein3d_jax.restore import restorer
from rein3d_jax.scene import Gaussians

RECIPE = "draft"
_REGIONS = {"seen": OBSERVED, "hidden": DISOCCLUDED, "never": NEVER_SEEN}


def scenes(room: EvaluationRoom, config: ReconstructConfig) -> Iterator[tuple[str, Gaussians, float]]:
    """Name, scene, and seconds of its layers."""
    panorama = room.panorama
    known, background = survey(panorama, config), room_background(panorama, config.restore)
    yield "lifted", known.coarse, 0.0
    none = PeelConfig(room=False, outside=False, lining=False)
    cases = {
        "+ room, by the shell's colours": ("background", replace(none, room=True)),
        "+ room, learned": ("learned", replace(none, room=True)),
        "+ outside": ("learned", replace(none, outside=True)),
        "+ room, learned, + outside": ("learned", replace(none, room=True, outside=True)),
        "+ room, learned, + outside, + lining": ("learned", PeelConfig()),
    }
    for name, (method, layers) in cases.items():
        stages = replace(config, peel=layers, restore=replace(config.restore, method=method))
        restore = restorer(stages.restore, background, read_network(stages.restore))
        for _ in range(2):  # the first compiles
            started = perf_counter()
            scene = jax.block_until_ready(peel_scene(known, background, restore, jax.random.key(0), stages=stages))
            seconds = perf_counter() - started
        yield name, scene, seconds


def rows(at: StudiedRoom) -> Iterator[tuple[str, dict]]:
    """Name and figures of each scene."""
    for name, scene, seconds in scenes(at.room, at.config):
        yield name, at.figures(scene, _REGIONS) | {"seconds": seconds}


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a variant and room, then the means."""
    return run_study("studies.peel", __doc__, RECIPE, rows, arguments)


if __name__ == "__main__":
    sys.exit(main())
