"""The paper's network at its full size, rehearsed with random weights: written, read, and one clip through every part.

    python -m benchmarks rehearsal --weights FOLDER [--frames 5 --height 128 --steps 2] [--json FILE]

FOLDER gets the weights in both layouts, 4.6 GB each in bfloat16, unless they are there. Each part is one compiled
program; its bytes are the peak of the process (a GPU's: of the device, so far), beside XLA's account and the forecast.
"""

import contextlib
import dataclasses
import json
import resource
import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from rein3d_jax.errors import InputError
from rein3d_jax.io.files.atomic import write_text
from rein3d_jax.networks.wan import random_wan, read_wan, write_wan
from rein3d_jax.restore.blend import blend
from rein3d_jax.restore.wan.condition import control_latents
from rein3d_jax.restore.wan.config import SMALL, TINY, DitConfig, VaeConfig, WanConfig
from rein3d_jax.restore.wan.cost import clip_cost, seconds_by_device
from rein3d_jax.restore.wan.names import LAYOUTS
from rein3d_jax.restore.wan.restore import DiffusionConfig, SampleConfig, clip_noise, clip_velocity
from rein3d_jax.restore.wan.sampler import sample_latents
from rein3d_jax.restore.wan.schedule import sampling_sigmas
from rein3d_jax.restore.wan.solver import SOLVERS
from rein3d_jax.restore.wan.training.memory import Workload, forecast
from rein3d_jax.restore.wan.vae import Vae

FULL = WanConfig(DitConfig(param_dtype="bfloat16"), VaeConfig(param_dtype="bfloat16"))
PRESETS = {"full": FULL, "small": SMALL, "tiny": TINY}


def main(arguments: list[str] | None = None) -> int:
    """Exit code 0, or 2 with one line on stderr where an argument is at fault."""
    parser = CommandParser("rehearsal", __doc__, "benchmarks")
    parser.add_argument("--weights", required=True, metavar="FOLDER", help="where they are, or are written")
    parser.add_argument("--preset", default="full", choices=PRESETS, help="the network's size (default: %(default)s)")
    parser.add_argument("--frames", type=int, default=5, help="1 + 4 n (default: %(default)s)")
    parser.add_argument("--height", type=int, default=128, help="multiples of 16 (default: %(default)s)")
    parser.add_argument("--steps", type=int, default=2, help="of the sampler (default: %(default)s)")
    parser.add_argument("--kernel", default="chunked", help="of the attention; cudnn on a GPU (default: %(default)s)")
    parser.add_argument("--dtype", default="bfloat16", help="of products and convolutions (default: %(default)s)")
    parser.add_argument("--layouts", nargs="+", default=LAYOUTS, choices=LAYOUTS, help="to write and read")
    parser.add_argument("--json", metavar="FILE", help="write the figures there")
    return parser.run(_run, arguments)


class Parts:
    """The rehearsal's parts, each timed: seconds, CPU seconds and peak bytes; `rows` holds them."""

    def __init__(self):
        self.rows = {}

    def run(self, name: str, make: Callable, *given):
        """What `make` returns, ready."""
        _forget_peak()
        wall, cpu = time.perf_counter(), _cpu()
        made = jax.block_until_ready(make(*given))
        self.rows[name] = {"seconds": time.perf_counter() - wall, "cpu_seconds": _cpu() - cpu, "peak_bytes": _peak()}
        print(f"{name:20} {self._text(name)}", flush=True)
        return made

    def program(self, name: str, call: Callable, *given):
        """What `call` returns, compiled first: two rows, and XLA's account of bytes and operations."""
        compiled = self.run(f"compile {name}", lambda: jax.jit(call).lower(*given).compile())
        made = self.run(name, compiled, *given)
        memory, cost = compiled.memory_analysis(), compiled.cost_analysis() or {}
        self.rows[name] |= {"temporary_bytes": memory.temp_size_in_bytes, "tflop": cost.get("flops", 0) / 1e12}
        return made

    def _text(self, name: str) -> str:
        row = self.rows[name]
        return f"{row['seconds']:8.1f} s {row['cpu_seconds']:8.1f} CPU s {row['peak_bytes'] / 2**30:7.2f} GiB"


def _run(options) -> None:
    config = PRESETS[options.preset]
    dit = dataclasses.replace(config.dit, kernel=options.kernel, dtype=options.dtype)
    config = WanConfig(dit, dataclasses.replace(config.vae, dtype=options.dtype))
    parts, shape = Parts(), (options.frames, options.height, 2 * options.height)
    params = _weights(Path(options.weights), config, options.layouts, parts)
    figures = _clip(params, DiffusionConfig(config, SampleConfig(steps=options.steps)), shape, parts)
    need = forecast(config, Workload(*shape))
    seconds = seconds_by_device(clip_cost(DiffusionConfig(config, SampleConfig(steps=options.steps)), *shape))
    size = sum(leaf.nbytes for leaf in jax.tree.leaves(params))
    result = {
        "device": jax.devices()[0].device_kind, "jax": jax.__version__, "preset": options.preset,
        "dtype": options.dtype, "clip": shape, "steps": options.steps, "weights_bytes": size,
        "foreseen_bytes": dataclasses.asdict(need) | {"total": need.total}, "foreseen_seconds": seconds,
        **figures, "parts": parts.rows,
    }  # fmt: skip
    print(json.dumps({key: value for key, value in result.items() if key != "parts"}, indent=1))
    if options.json:
        write_text(Path(options.json), json.dumps(result, indent=1) + "\n")


def _weights(folder: Path, config: WanConfig, layouts, parts: Parts):
    """The parameters read from the last of `layouts`, which are written first where they are not there."""
    lacking = [name for name in layouts if not (folder / name / "transformer").is_dir()]
    if lacking:
        drawn = parts.run("draw", random_wan, 0, config)
        for name in lacking:
            parts.run(f"write {name}", partial(write_wan, folder / name, drawn, config, layout=name))
        del drawn
    for name in layouts:
        params = None  # one at a time
        params = parts.run(f"read {name}", read_wan, folder / name, config)
    return params


def _clip(params, config: DiffusionConfig, shape: tuple[int, int, int], parts: Parts) -> dict:
    """A clip of smooth colours with a hole through encoder, sampler, decoder and blend; laws that it must keep."""
    network, sampling, (frames, height, _) = config.network, config.sample, shape
    if (frames - 1) % network.vae.time_stride or height % 16:
        raise InputError(f"--frames {frames} --height {height}: take 1 + {network.vae.time_stride} n and 16 n")
    vae, (rgb, alpha) = Vae(network.vae), _smooth_clip(shape)

    def encode(weights, video):
        return vae.apply({"params": weights}, video, method="encode")

    def condition(weights, rgb, alpha):
        return control_latents(
            lambda x: encode(weights, x), rgb[None], alpha[None], rgb[:1], stride=network.vae.stride
        )  # fmt: skip

    solver = SOLVERS[sampling.solver](sampling_sigmas(sampling.steps, sampling.shift))
    yaw_step = network.dit.patch[2] if sampling.random_yaw else 0

    def denoise(params, noise, control, key):
        return sample_latents(
            key, clip_velocity(params, network, sampling.guidance), noise, control, solver, yaw_step=yaw_step
        )  # fmt: skip

    def decode(weights, latents):
        return (vae.apply({"params": weights}, latents[:, 1:], method="decode")[0] + 1) / 2

    control = parts.program("encode", condition, params.vae, rgb, alpha)
    noise = parts.run("noise", clip_noise, jax.random.key(0), shape, config)[None]
    latents = parts.program("denoise", denoise, params, noise, control, jax.random.key(1))
    drawn = parts.program("decode", decode, params.vae, latents)
    mixed = parts.program("blend", lambda a, b, c: blend(a, b, c, observed=0.5), drawn, rgb, alpha)
    kept = np.asarray(alpha) == 1
    return {
        "finite": bool(all(jnp.isfinite(x).all() for x in (control, latents, drawn, mixed))),
        "observed_changed": float(np.abs(np.asarray(mixed) - np.asarray(rgb))[kept].max()),
        "seam": _seam(params.vae, network.vae, rgb),
    }


def _smooth_clip(shape):
    _, height, width = shape
    t, v, u = np.meshgrid(*(np.linspace(0, 2 * np.pi, n, endpoint=False) for n in shape), indexing="ij")
    rgb = np.stack([np.sin(u + t), np.cos(u + v), np.sin(v)], axis=-1) / 4 + 0.5
    alpha = np.ones(shape)
    alpha[1:, height // 4 : height // 2, width // 8 : width // 3] = 0
    return jnp.asarray(rgb, jnp.float32), jnp.asarray(alpha, jnp.float32)


def _seam(weights, config: VaeConfig, rgb) -> float:
    """Largest difference, over the latents' own spread, between encoding a panorama turned by whole latents and turning
    its latents, where the VAE's width is a circle."""
    circular = Vae(dataclasses.replace(config, circular=True))
    encode = jax.jit(lambda video: circular.apply({"params": weights}, video, method="encode"))
    video, turn = 2 * rgb[None, :1] - 1, 4
    there = encode(jnp.roll(video, turn * config.stride, axis=3))
    here = jnp.roll(encode(video), turn, axis=3)
    return float(jnp.abs(there - here).max() / jnp.std(here))


def _cpu() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


def _forget_peak() -> None:
    with contextlib.suppress(OSError):  # elsewhere than on Linux: a peak so far
        Path("/proc/self/clear_refs").write_text("5")


def _peak() -> int:
    device = jax.devices()[0]
    if device.platform != "cpu":
        return device.memory_stats()["peak_bytes_in_use"]
    status = Path("/proc/self/status").read_text()
    return 1024 * int(next(line for line in status.splitlines() if line.startswith("VmHWM")).split()[1])


if __name__ == "__main__":
    sys.exit(main())
