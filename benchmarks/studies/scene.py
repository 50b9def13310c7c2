"""Tables of what each choice of the main job buys, over rooms: PSNR at novel views, count and seconds.

    python -m benchmarks.studies.scene TABLE --rooms FOLDER [--limit N] [--json FILE]

Every row is quick.toml at half its size with some keys changed. Stages that two rows share are made once. Seconds are
those of a row's stages, the median over rooms: the first ones compile.
"""

import dataclasses
import hashlib
import itertools
import json
import sys
from collections import deque
from pathlib import Path
from time import perf_counter

import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from experiments.compiled_programs import forget_when_many
from experiments.config import load_config
from experiments.evaluate.room import EvaluationRoom, RoomSource, room_sources
from experiments.reconstruct.budget import within
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.quality import is_novel, render_views
from rein3d_jax.evaluate.metrics import psnr
from rein3d_jax.explore.trajectories import radial_trajectories
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.networks.trained import read_network
from rein3d_jax.peel import PeelConfig
from rein3d_jax.pipeline.explore_and_restore import Explored, explore_and_restore
from rein3d_jax.pipeline.peel_scene import peel_scene
from rein3d_jax.pipeline.refine_scene import collect_views, refine_scene, where_it_pays
from rein3d_jax.pipeline.survey import Survey, lift_scene, room_background
from rein3d_jax.restore import restorer
from rein3d_jax.scene import Gaussians

RECIPE = "quick"
SIZE = ("input.height=128", "restore.height=128", "lift.share=1.0", "refine.views.size=64", "refine.steps=200",
        "refine.evaluate_every=200")  # fmt: skip
WHOLE = ("input.height=256", "restore.height=256", "lift.share=0.99", "lift.worth=0", "input.upsample=none")
NO_LAYERS = tuple(f"peel.{layer.name}=false" for layer in dataclasses.fields(PeelConfig))
EVERY_PATH = ("explore.min_revealed=0",)
GROWING = ("refine.densification=default", "refine.densify.start=25", "refine.densify.every=25",
           "refine.densify.stop=151", "refine.spare=0.2")  # fmt: skip
AUTOMATIC = ("explore.min_revealed=0.005", "lift.share=0.5", "refine.steps=400", "refine.evaluate_every=100",
             "refine.plateau=0.1", "refine.patience=1")  # fmt: skip


def tables() -> dict[str, dict[str, tuple[str, ...]]]:
    """Rows by table: name -> the recipe's keys that it changes. The first row is the one that others are held to."""
    weights = {f"guesses weigh {w}": (f"refine.loss.restored={w}",) for w in (1.0, 0.5, 0.25)}
    grid = itertools.product((0.25, 0.5, 1.0), (2, 4, 8), (0, 400))
    return {
        "exploration": {
            "layers behind, a path where 1 % is open": (),
            "the same, without what is outside": ("peel.outside=false",),
            "layers behind, every path": EVERY_PATH,
            "every path, no layers": (*EVERY_PATH, *NO_LAYERS),
            "4 paths": (*EVERY_PATH, *NO_LAYERS, "explore.trajectories=4"),
            "2 paths": (*EVERY_PATH, *NO_LAYERS, "explore.trajectories=2"),
            "local, 8 paths of 0.5 m": (*EVERY_PATH, *NO_LAYERS, "explore.max_length=0.5", "explore.step=0.25"),
            "each path alone": (*EVERY_PATH, *NO_LAYERS, "restore.sequential=false"),
            "each path alone, behind layers": (*EVERY_PATH, "restore.sequential=false"),
            "not refined": (*EVERY_PATH, *NO_LAYERS, "refine.steps=0"),
            "neither path nor layer": (*EVERY_PATH, *NO_LAYERS, "restore.method=none"),
        },
        "weights": weights
        | {
            "what was seen refined too": ("refine.freeze_observed=false",),
            "harmonics of degree 1": ("refine.sh_degree=1", "refine.sh_degree_every=1"),
        },
        "parsimony": {
            "one a pixel": (),
            "share 0.5": ("lift.share=0.5",),
            "share 0.25": ("lift.share=0.25",),
            "share 0.15": ("lift.share=0.15",),
        },
        "tolerance": {f"{decibels} dB": (*WHOLE, f"budget.tolerance={decibels}") for decibels in (0, 0.1, 0.2, 0.5, 1)},
        "steps": {f"{steps} steps": (f"refine.steps={steps}",) for steps in (0, 50, 150, 400, 1000, 2000)},
        "seeds": {
            f"{kind}, seed {seed}{again}": (*GROWING, f"refine.densification={kind}", f"seed={seed}")
            for kind in ("default", "mcmc")
            for seed, again in ((0, ""), (1, ""), (2, ""), (3, ""), (4, ""), (0, " again"))
        },
        "choice": {"automatic": AUTOMATIC}
        | {
            f"share {share}, {paths} paths, {steps} steps": (
                f"lift.share={share}", f"explore.trajectories={paths}", f"refine.steps={steps}",
            )
            for share, paths, steps in grid
        },
    }  # fmt: skip


class Bench:
    """A room, and what was made of it so far."""

    def __init__(self, source: RoomSource):
        self.source, self.made = source, {}

    def once(self, key, make):
        """(result, seconds): made when first asked for."""
        if key not in self.made:
            started = perf_counter()
            result = jax.block_until_ready(make())
            self.made[key] = (result, perf_counter() - started)
        return self.made[key]

    def fused(self, config: ReconstructConfig) -> tuple[list[Explored], float]:
        """The state after each path, and the seconds of all stages so far."""
        room = EvaluationRoom(self.source, config)
        panorama, _ = self.once(config.input.height, lambda: room.panorama)
        coarse, lifting = self.once(config.lift, lambda: lift_scene(panorama, config.lift))
        paths, _ = self.once(config.explore, lambda: radial_trajectories(panorama, config=config.explore))
        background, knowing = self.once("background", lambda: room_background(panorama, config.restore))
        restore = restorer(config.restore, background, read_network(config.restore))
        known, states = Survey(panorama, coarse, paths), []
        keys = jax.random.split(jax.random.key(config.seed))
        scene, peeling = self.once(
            (config.lift, config.explore, config.peel, config.restore, config.seed),
            lambda: peel_scene(known, background, restore, keys[1], stages=config),
        )
        known, seconds = known.replace(coarse=scene), lifting + knowing + peeling
        for index in range(config.explore.trajectories):
            start = states[-1] if states else None
            following = explore_and_restore(known, restore, keys[0], stages=config, start=start)
            key = (config.lift, config.explore, config.peel, config.restore, config.seed, index)
            state, spent = self.once(key, lambda following=following: next(following))
            states, seconds = [*states, state], seconds + spent
        return states, seconds

    def refined(self, config: ReconstructConfig) -> tuple[Gaussians, float]:
        """The scene of `config`, and its seconds."""
        states, seconds = self.fused(config)
        panorama = self.made[config.input.height][0]
        started = perf_counter()
        videos = [state.video for state in states]
        config = where_it_pays(config, videos)
        views = collect_views(panorama, videos, stages=config)
        key = jax.random.key(config.seed + 1)
        (last,) = deque(refine_scene(states[-1].scene, views, panorama, key, stages=config), maxlen=1)
        return jax.block_until_ready(last.scene), seconds + perf_counter() - started

    def row(self, config: ReconstructConfig) -> dict:
        """PSNR meaned over the novel views, Gaussians, seconds, paths that were restored, and a digest of the scene."""
        scene, seconds = self.refined(config)
        room = EvaluationRoom(self.source, config)
        views = [view for view in room.traced.views if is_novel(view)]
        (pictures,) = render_views([scene], views, room.backdrop, config=config.rasterize)
        found = float(np.mean([psnr(picture, view.rgb) for picture, view in zip(pictures, views, strict=True)]))
        restored = sum(state.video.rgb.shape[0] > 1 for state in self.fused(config)[0])
        digest = hashlib.sha256(b"".join(np.asarray(leaf).tobytes() for leaf in jax.tree.leaves(scene))).hexdigest()
        return {"psnr": found, "count": int(jnp.sum(scene.alive)), "seconds": seconds, "paths": restored,
                "digest": digest}  # fmt: skip


def summary(rows: list[dict], base: list[dict]) -> dict:
    """[mean, standard error] over rooms of PSNR, of its gain over `base` room by room, and of the count; the median of
    seconds."""
    gain = [row["psnr"] - other["psnr"] for row, other in zip(rows, base, strict=True)]
    values = {"psnr": [row["psnr"] for row in rows], "gain": gain, "count": [row["count"] for row in rows],
              "paths": [row["paths"] for row in rows]}  # fmt: skip
    meaned = {name: [round(float(np.mean(v)), 3), round(_error(v), 3)] for name, v in values.items()}
    return meaned | {"seconds": round(float(np.median([row["seconds"] for row in rows])), 2)}


def _error(values: list[float]) -> float:
    return float(np.std(values, ddof=1)) / len(values) ** 0.5 if len(values) > 1 else 0.0


def measure(variants: dict[str, tuple[str, ...]], sources: list[RoomSource]) -> dict[str, list[dict]]:
    """Row -> a figure for each room, room by room: what rows share is kept no longer than a room."""
    found = {name: [] for name in variants}
    for source in sources:
        bench = Bench(source)
        for name, keys in variants.items():
            config = load_config(ReconstructConfig, RECIPE, [*SIZE, *keys])
            found[name].append(bench.row(within(config, config.budget)))
            print(source.name, name, found[name][-1], flush=True)
            forget_when_many()
    return found


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a row."""
    parser = CommandParser("studies.scene", __doc__, "benchmarks")
    parser.add_argument("table", choices=tables())
    parser.add_argument("--rooms", metavar="FOLDER", required=True)
    parser.add_argument("--limit", type=int, help="rooms at most")
    parser.add_argument("--json", metavar="FILE", help="write the table there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    sources = room_sources(options.rooms, options.limit)
    found = measure(tables()[options.table], sources)
    base = next(iter(found.values()))
    rows = {name: summary(rows, base) | {"each": rows} for name, rows in found.items()}
    for name, row in rows.items():
        print(f"{name:36s}", {key: value for key, value in row.items() if key != "each"})
    if options.json:
        table = {"recipe": RECIPE, "changed": SIZE, "rooms": [source.name for source in sources], "rows": rows}
        write_text(Path(options.json), json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    sys.exit(main())
