"""Operations and bytes of the paper's programs, lowered for CUDA and TPU with abstract values, beside the forecast."""

import json
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax import export

from experiments.command import CommandParser
from experiments.train_restore.learned.config import LearnedTrainConfig
from experiments.train_restore.learned.step import ExampleBatch, initial_learned_state, make_learned_step
from experiments.train_restore.wan.config import WanTrainConfig
from experiments.train_restore.wan.data import PairBatch
from experiments.train_restore.wan.step import initial_wan_state, make_wan_step
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import equirectangular_camera
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.lift import lift
from rein3d_jax.lift.config import LiftConfig
from rein3d_jax.rasterize import Buffers, RasterizeConfig, rasterize
from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.refine.state import initial_state
from rein3d_jax.refine.step import Chance, batch_sums, update
from rein3d_jax.refine.views import Views
from rein3d_jax.restore.learned.condition import CANDIDATES, Clip
from rein3d_jax.restore.learned.config import NetworkConfig
from rein3d_jax.restore.learned.loss import Example
from rein3d_jax.restore.learned.network import initial_parameters
from rein3d_jax.restore.learned.sample import Learned, sample_clip
from rein3d_jax.restore.wan.cost import clip_cost, pass_flops, program_flops, vae_flops
from rein3d_jax.restore.wan.restore import DegradedClip, DiffusionConfig, WanParams, clip_noise, restore_frames
from rein3d_jax.restore.wan.training.memory import GIB, Workload, dit_shapes, forecast, vae_shapes
from rein3d_jax.scene import Gaussians, Panorama

PLATFORMS = ("cuda", "tpu")
FRAMES, HEIGHT, WIDTH = 41, 448, 896  # of a clip (paper, Sec. 5.1)
VIEW, VIEWS, BATCH = 512, 12 + 8 * 40 * 6, 4  # the refinement's: side, those of 8 paths and the input, a step's
SLOTS = 2 * HEIGHT * WIDTH  # Gaussians of a lifted panorama, and as many free
# The rasterizer's, with room for what a lifted panorama of this size needs.
BUFFERS = Buffers(visible=HEIGHT * WIDTH, rows=4 * HEIGHT * WIDTH, pairs=8 * HEIGHT * WIDTH, chunks=HEIGHT * WIDTH)
TRAIN_CLIPS = 4  # a step's, of the learned restorer; the full-size network's are one a device, 8 parts of a step


class Program(NamedTuple):
    """A function, and the abstract values that it is lowered with."""

    function: Callable
    given: tuple[Any, ...]
    carried: int | None = None  # the argument that is a state, used up and returned anew


def _array(*shape: int, dtype=jnp.float32):
    return jax.ShapeDtypeStruct(shape, dtype)


def _gaussians(degree: int = 0) -> Gaussians:
    flat, sh = _array(SLOTS), _array(SLOTS, (degree + 1) ** 2, 3)
    return Gaussians(_array(SLOTS, 3), _array(SLOTS, 3), _array(SLOTS, 4), flat, sh, _array(SLOTS, dtype=bool))


def _lift() -> Program:
    area = _array(HEIGHT, WIDTH)
    panorama = Panorama(_array(HEIGHT, WIDTH, 3), area, _array(HEIGHT, WIDTH, dtype=bool))
    given = (panorama, _array(4, 4), _array(HEIGHT, WIDTH, dtype=bool))
    return Program(partial(lift, config=LiftConfig()), given)


def _rasterize() -> Program:
    def picture(scene, pose):
        return rasterize(scene, equirectangular_camera(pose, HEIGHT), config=RasterizeConfig(), buffers=BUFFERS)

    return Program(picture, (_gaussians(), _array(4, 4)))


def _clip(*lead: int) -> Clip:
    area = (*lead, FRAMES, HEIGHT, WIDTH)
    fills = _array(*area, CANDIDATES, 3), _array(*area, CANDIDATES)
    return Clip(_array(*area, 3), _array(*area), _array(*area), *fills, _array(*lead, FRAMES, 3))


def _restore_learned() -> Program:
    network = NetworkConfig(rows=56)  # 448 = 8 x 56; the shipped 64 rows are for 512
    parameters = jax.eval_shape(partial(initial_parameters, config=network), jax.random.key(0))

    def restored(parameters, clip, key):
        return sample_clip(key, Learned(parameters, network), clip, 1)

    return Program(restored, (parameters, _clip(), jax.eval_shape(jax.random.key, 0)))


def _wan_params(network) -> WanParams:
    text = _array(512, network.dit.text_dim)
    return WanParams(dit_shapes(network.dit), vae_shapes(network.vae), text, text)


def _restore_diffusion() -> Program:
    config = DiffusionConfig()
    clip = DegradedClip(_array(FRAMES, HEIGHT, WIDTH, 3), _array(FRAMES, HEIGHT, WIDTH), _array(HEIGHT, WIDTH, 3))
    key = jax.eval_shape(jax.random.key, 0)
    noise = jax.eval_shape(partial(clip_noise, shape=(FRAMES, HEIGHT, WIDTH), config=config), key)
    return Program(partial(restore_frames, config=config), (key, _wan_params(config.network), clip, noise))


def _refine() -> Program:
    config, raster = RefineConfig(batch=BATCH), RasterizeConfig()
    start = partial(initial_state, config=config, extent=3.0)
    views = Views(_array(BATCH, VIEW, VIEW, 3), _array(BATCH, VIEW, VIEW), _array(BATCH, 4, 4), _array(BATCH))
    chance = Chance(_array(BATCH, dtype=jnp.int32), _array(3), jax.eval_shape(jax.random.key, 0))

    def step(state, views, chance):
        fixed = {"config": config, "buffers": BUFFERS}
        sums, needed = batch_sums(state, views, chance.backdrop, raster=raster, **fixed)
        return update(state, sums, needed, chance, **fixed)

    return Program(step, (jax.eval_shape(start, _gaussians(3)), views, chance), carried=0)


def _alone(x):
    return x


def _train_learned() -> Program:
    config = LearnedTrainConfig(precision="bfloat16", network=NetworkConfig(rows=56), batch=TRAIN_CLIPS)
    clips = (1, TRAIN_CLIPS)
    area = (*clips, FRAMES, HEIGHT, WIDTH)
    examples = Example(_clip(*clips), _array(*area, 3), _array(*area))
    batch = ExampleBatch(examples, _array(*clips, 2, dtype=jnp.uint32))
    state = jax.eval_shape(partial(initial_learned_state, config))
    return Program(partial(make_learned_step(config), total=_alone), (state, batch), carried=0)


def _train_wan() -> Program:
    config = WanTrainConfig()  # the paper's
    parts = (config.accumulate, 1)
    area = (*parts, FRAMES, HEIGHT, WIDTH)
    batch = PairBatch(_array(*area, 3), _array(*area, 3), _array(*area), _array(*parts, 2, dtype=jnp.uint32))
    state = jax.eval_shape(partial(initial_wan_state, config=config), _wan_params(config.network))
    return Program(partial(make_wan_step(config), total=_alone), (state, batch), carried=0)


PROGRAMS = {
    "lift": _lift,
    "rasterize": _rasterize,
    "restore learned": _restore_learned,
    "restore diffusion": _restore_diffusion,
    "refine step": _refine,
    "train learned": _train_learned,
    "train diffusion": _train_wan,
}


def jitted(program: Program):
    """The function with its state donated."""
    return jax.jit(program.function, donate_argnums=() if program.carried is None else program.carried)


def exported(program: Program) -> export.Exported:
    """The program lowered for all PLATFORMS at once."""
    return export.export(jitted(program), platforms=PLATFORMS)(*program.given)


def array_bytes(tree: Any) -> int:
    """Bytes of the arrays; a key is two words."""
    keys = [jnp.issubdtype(x.dtype, jax.dtypes.prng_key) for x in jax.tree.leaves(tree)]
    sizes = zip(jax.tree.leaves(tree), keys, strict=True)
    return sum(x.size * (8 if key else x.dtype.itemsize) for x, key in sizes)


def foreseen(name: str) -> dict[str, float]:
    """What memory.py and cost.py say of a program of the full-size network."""
    config, whole = DiffusionConfig(), Workload(FRAMES, HEIGHT, WIDTH)
    if name == "restore diffusion":
        cost = clip_cost(config, FRAMES, HEIGHT, WIDTH)
        return {"flops": cost.total, "bytes": forecast(config.network, whole).total}
    if name == "train diffusion":
        training = WanTrainConfig()
        work = Workload(FRAMES, HEIGHT, WIDTH, train=True, trainable=training.trainable)
        latents = (2 + (FRAMES - 1) // 4, HEIGHT // 8, WIDTH // 8)
        passes = 4 * pass_flops(training.network.dit, latents, 512)  # two for the gradient, one to recompute each block
        encode = partial(vae_flops, training.network.vae, height=HEIGHT, width=WIDTH, decode=False)
        encoded = 3 * encode(FRAMES) + encode(1)  # clean, two parts of the control, the anchor
        need = forecast(training.network, work).total
        return {"flops": training.accumulate * (passes + encoded), "bytes": need}
    return {}


def measured(name: str, *, compiled: bool) -> dict[str, Any]:
    """Figures of one program; `compiled` for this machine's own device, too, which takes no memory for the values."""
    program, begun = PROGRAMS[name](), time.perf_counter()
    lowered = jitted(program).lower(*program.given)
    figures = {"lower_s": time.perf_counter() - begun, "given_bytes": array_bytes(program.given)}
    figures["donated_bytes"] = 0 if program.carried is None else array_bytes(program.given[program.carried])
    if "restore" in name or "train" in name:
        figures["flops"] = program_flops(program.function, *program.given)
    figures["foreseen"] = foreseen(name)
    if compiled:
        begun = time.perf_counter()
        memory = lowered.compile().memory_analysis()
        sizes = ("argument_size_in_bytes", "output_size_in_bytes", "temp_size_in_bytes", "alias_size_in_bytes")
        figures["compiled"] = {"seconds": time.perf_counter() - begun} | {x: getattr(memory, x) for x in sizes}
    return figures


def main(arguments: list[str] | None = None) -> int:
    """Prints a line for each program."""
    parser = CommandParser("studies.accelerators", __doc__, "benchmarks")
    parser.add_argument("--compile", action="store_true", help="for this machine's device, and what it reserves")
    parser.add_argument("--only", metavar="NAME", help=f"one of {', '.join(PROGRAMS)}")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    if options.only not in (None, *PROGRAMS):
        raise InputError(f"--only {options.only}: choose one of {', '.join(PROGRAMS)}")
    device = jax.devices()[0].device_kind
    result: dict[str, Any] = {"device": device, "jax": jax.__version__, "programs": {}}
    for name in [options.only] if options.only else PROGRAMS:
        try:
            figures = measured(name, compiled=options.compile)
        except jax.errors.JaxRuntimeError as error:  # what a device has no room for is a figure, too
            figures = {"refused": " ".join(str(error).split())[:300]}
        result["programs"][name] = figures
        print(f"{name}: {_line(figures)}", flush=True)
        if options.json:
            write_text(Path(options.json), json.dumps(result, indent=1) + "\n")


def _line(figures: dict[str, Any]) -> str:
    if "refused" in figures:
        return figures["refused"]
    told = [f"lowered in {figures['lower_s']:.1f} s", f"given {figures['given_bytes'] / GIB:.2f} GiB"]
    told.append(f"donated {figures['donated_bytes'] / GIB:.2f} GiB")
    if "flops" in figures:
        told.append(f"{figures['flops'] / 1e12:,.3g} TFLOP")
    if foreseen := figures["foreseen"]:
        told.append(f"foreseen {foreseen['flops'] / 1e12:,.3g} TFLOP, {foreseen['bytes'] / GIB:.1f} GiB")
    if compiled := figures.get("compiled"):
        whole = compiled["argument_size_in_bytes"] + compiled["temp_size_in_bytes"]
        told.append(f"compiled in {compiled['seconds']:.0f} s, reserves {whole / GIB:.1f} GiB")
    return ", ".join(told)


if __name__ == "__main__":
    sys.exit(main())
