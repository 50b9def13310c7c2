"""Panoramas a second that rein3d_jax.rooms traces.

For each of several rooms, frames along a short path, compiled once and warm; compile seconds apart."""

import json
import os
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from experiments.command import CommandParser
from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.sphere import world_from_camera_axes
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.tracing.trace import trace


def main(arguments: list[str] | None = None) -> int:
    """Prints a line a room and the median."""
    parser = CommandParser("rooms", __doc__, "benchmarks")
    parser.add_argument("--height", type=int, default=128, help="rows of a panorama (%(default)s)")
    parser.add_argument("--frames", type=int, default=16, help="frames a room (%(default)s)")
    parser.add_argument("--samples", type=int, default=1, help="rays a pixel, per side (%(default)s)")
    parser.add_argument("--rooms", type=int, default=8, help="rooms (%(default)s)")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the figures there")
    return parser.run(_run, arguments)


def _run(options) -> None:
    figures = measure(options.height, options.frames, options.samples, options.rooms)
    if options.json:
        options.json.write_text(json.dumps(figures, indent=1) + "\n")


def measure(height: int, frames: int, samples: int, rooms: int) -> dict:
    """Compile seconds of a room and of its panoramas, and panoramas a second in each room."""
    make, make_seconds = _compiled(jax.jit(generate_room, static_argnums=1), jax.random.key(0), RoomConfig())
    poses = jax.vmap(lambda x: rigid(world_from_camera_axes(), jnp.stack([x, 0 * x, 0 * x])))(
        jnp.linspace(0, 0.3, frames)
    )
    tracer = jax.jit(trace, static_argnums=2, static_argnames="samples")
    follow, trace_seconds = _compiled(tracer, make(jax.random.key(0)), poses, height, samples=samples)
    rates = []
    for seed in range(rooms):
        drawn = make(jax.random.key(seed))
        seconds = min(_seconds(follow, drawn, poses) for _ in range(3))
        solids = [int(family.count) for family in (drawn.boxes, drawn.cylinders, drawn.ellipsoids)]
        rates.append(frames / seconds)
        print(f"room {seed}: {solids} boxes, cylinders, ellipsoids: {rates[-1]:.1f} panoramas/s", flush=True)
    figures = {"height": height, "frames": frames, "samples": samples, "device": jax.devices()[0].device_kind}
    figures |= {"cores": len(os.sched_getaffinity(0)), "room_compile_seconds": make_seconds}
    figures |= {"trace_compile_seconds": trace_seconds, "panoramas_per_second": rates}
    print(
        f"{height}x{2 * height}, {samples}x{samples} rays a pixel, {figures['cores']} cores: median "
        f"{np.median(rates):.1f}, slowest {min(rates):.1f} panoramas/s; compiled in {make_seconds:.1f} s (room) "
        f"and {trace_seconds:.1f} s (panoramas)"
    )
    return figures


def _compiled(function, *arguments, **options):
    start = time.perf_counter()
    compiled = function.lower(*arguments, **options).compile()
    return compiled, time.perf_counter() - start


def _seconds(function, *arguments) -> float:
    start = time.perf_counter()
    jax.block_until_ready(function(*arguments))
    return time.perf_counter() - start


if __name__ == "__main__":
    sys.exit(main())
