"""rein3d_jax: one indoor panorama in, one explorable 3D Gaussian scene out. Stages are pure functions over pytrees.

    import jax
    import rein3d_jax as r3d

    panorama = r3d.read_panorama("pano.jpg", distance="depth.exr", height=256)
    result = r3d.reconstruct(panorama, jax.random.key(0), stages=r3d.Stages())
    camera = r3d.equirectangular_camera(r3d.upright(jax.numpy.zeros(3)), height=256)
    frame, _ = r3d.render(result.scene, camera, config=r3d.Stages().rasterize)
    r3d.write_splats("room.ply", result.scene)

A stage is a package of its own, by name: r3d.depth, r3d.lift, r3d.explore, r3d.peel, r3d.rasterize, r3d.restore,
r3d.upsample, r3d.refine, r3d.evaluate. What is named here is imported when it is first asked for.
"""

import importlib

__version__ = "0.2.0"

# name -> the module that it stands in, and its name there where that is another
_DOORS = {
    **dict.fromkeys(("Camera", "Gaussians", "Pair", "Panorama", "Video"), "scene"),
    **dict.fromkeys(("equirectangular_camera", "pinhole_camera", "upright"), "geometry.poses"),
    "InputError": "errors",
    "render": "rasterize",
    "read_panorama": "io.pictures.panorama",
    "read_network": "networks.trained",
    "read_depth_network": "networks.depth",
    "read_upsampler": "networks.upsampler",
    **dict.fromkeys(("read_splats", "write_splats"), "io.splats.gaussian_file"),
    "read_gaussians": "io.splats.gaussian_file:read_splats",  # as tools that measure scenes ask for it
    **dict.fromkeys(("Decisions", "Reconstruction", "reconstruct"), "pipeline.reconstruct"),
    "Stages": "pipeline.stages",
    **dict.fromkeys(("Survey", "survey", "with_distance"), "pipeline.survey"),
    **dict.fromkeys(("Explored", "explore_and_restore"), "pipeline.explore_and_restore"),
    "peel_scene": "pipeline.peel_scene",
    **dict.fromkeys(("collect_views", "refine_scene"), "pipeline.refine_scene"),
}
_STAGES = ("depth", "lift", "explore", "peel", "rasterize", "restore", "upsample", "refine", "evaluate")
_ROOMS = ("conventions", "geometry", "rooms", *_STAGES)

__all__ = ["__version__", *_DOORS, *_ROOMS]


def __getattr__(name: str):
    if name in _ROOMS:
        return importlib.import_module(f"{__name__}.{name}")
    if name in _DOORS:
        module, _, there = _DOORS[name].partition(":")
        return getattr(importlib.import_module(f"{__name__}.{module}"), there or name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
