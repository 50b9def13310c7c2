"""rein3d_jax's rasterizer as an engine: `build(workload)` gives what one picture and one gradient take."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import optax

from benchmarks.engines.engine import Engine
from benchmarks.workloads import Workload
from rein3d_jax.conventions import PINHOLE
from rein3d_jax.rasterize import ADDED, RasterizeConfig, allocate, rasterize
from rein3d_jax.rasterize.composite import composite_chunks
from rein3d_jax.rasterize.cull import gather_in_view, in_view
from rein3d_jax.rasterize.pixels import from_tiles
from rein3d_jax.rasterize.project import project
from rein3d_jax.rasterize.tile import bin_splats
from rein3d_jax.refine import RefineConfig
from rein3d_jax.refine.parameters import join_parameters, make_optimizer, split_parameters
from rein3d_jax.scene import Camera, Gaussians

# What the peers composite, colour and alpha, by gsplat's filter.
CONFIG = RasterizeConfig(antialias=False, filter=ADDED, filter_variance=0.3, distance=False)
SH_DC = 0.28209479177387814


def scene_of(workload: Workload) -> Gaussians:
    """The workload's splats; harmonics of degree 0 that show its colours."""
    w = jax.tree.map(jnp.asarray, {k: v for k, v in vars(workload).items() if isinstance(v, np.ndarray)})
    logits = jnp.log(w["opacities"] / (1 - w["opacities"]))
    harmonics = ((w["colours"] - 0.5) / SH_DC)[:, None]
    alive = jnp.ones(len(logits), bool)
    return Gaussians(w["means"], jnp.log(w["scales"]), w["quats"], logits, harmonics, alive)


def camera_of(workload: Workload) -> Camera:
    """At the origin; world axes are the camera's."""
    size = workload.size
    centre = jnp.array([size.width / 2, size.height / 2])
    return Camera(jnp.eye(4), jnp.full(2, workload.focal, jnp.float32), centre, PINHOLE, size.width, size.height)


def build(workload: Workload) -> Engine:
    """Buffers are measured outside jit, as a user's driver does."""
    scene, camera, target = scene_of(workload), camera_of(workload), jnp.asarray(workload.target)
    buffers = allocate(scene, [camera], config=CONFIG)
    picture = partial(rasterize, config=CONFIG, buffers=buffers)

    def loss(floats):
        return jnp.mean((picture(scene.replace(**floats), camera).rgb - target) ** 2)

    names = ("means", "log_scales", "quats", "opacity_logits", "sh")
    floats = {name: getattr(scene, name) for name in names}
    gradient = jax.jit(jax.value_and_grad(loss))
    needed = picture(scene, camera).needed
    memory = gradient.lower(floats).compile().memory_analysis()
    sizes = memory.temp_size_in_bytes + memory.argument_size_in_bytes + memory.output_size_in_bytes
    return Engine(
        forward=lambda: picture(scene, camera),
        gradient=lambda: gradient(floats),
        wait=jax.block_until_ready,
        step=_stepper(scene, camera, target, picture),
        facts={
            "visible": int(needed[0]),
            "pairs": int(needed[2]),
            "evaluations": int(needed[2]) * CONFIG.tile**2,
            "buffer_bytes_per_gaussian": sizes / workload.size.count,
        },
        parts=_parts(scene, camera, buffers),
    )


def _stepper(scene, camera, target, picture):
    """The refinement's own optimizer on the workload's loss."""
    optimizer = make_optimizer(RefineConfig(sh_degree=0))

    def loss(parameters):
        frame = picture(join_parameters(parameters, scene.alive), camera)
        return jnp.mean((frame.rgb - target) ** 2)

    @partial(jax.jit, donate_argnums=0)
    def advance(state):
        parameters, memory = state
        updates, memory = optimizer.update(jax.grad(loss)(parameters), memory, parameters)
        return optax.apply_updates(parameters, updates), memory

    parameters = split_parameters(jax.tree.map(jnp.copy, scene))
    held = [(parameters, optimizer.init(parameters))]

    def step():
        held[0] = advance(held[0])
        return held[0]

    return step


def _parts(scene, camera, buffers):
    """The stages of a picture, each compiled alone: name -> call."""
    tile = CONFIG.tile
    cull = jax.jit(lambda scene: gather_in_view(scene, in_view(scene, camera, config=CONFIG), buffers.visible)[0])
    place = jax.jit(lambda seen: project(seen, camera, config=CONFIG))
    bin_ = jax.jit(lambda splats: bin_splats(splats, camera, config=CONFIG, buffers=buffers))
    paint = jax.jit(lambda s, c: from_tiles(composite_chunks(s, s.rgb, c, camera, tile), camera, tile))
    seen = cull(scene)
    splats = place(seen)
    chunks = bin_(splats)
    return {
        "culling": lambda: cull(scene),
        "projection": lambda: place(seen),
        "binning": lambda: bin_(splats),
        "compositing": lambda: paint(splats, chunks),
    }
