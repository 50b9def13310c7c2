"""Equirectangular cameras and Cycles' settings. The room's frame is Blender's: right-handed, metres, z up."""

import math

import bpy


def set_camera(view: dict) -> None:
    """A panorama of view["height"] rows at view["place"], its centre column along view["yaw"] from +x to +y."""
    scene = bpy.context.scene
    camera = bpy.data.objects.get("camera")
    if camera is None:
        data = bpy.data.cameras.new("camera")
        data.type = "PANO"
        data.panorama_type = "EQUIRECTANGULAR"
        data.clip_start, data.clip_end = 0.01, 1000.0
        camera = bpy.data.objects.new("camera", data)
        scene.collection.objects.link(camera)
    camera.location = view["place"]
    camera.rotation_euler = (math.pi / 2, 0.0, view["yaw"] - math.pi / 2)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 2 * view["height"], view["height"]
    scene.render.resolution_percentage = 100


def set_render(samples: int, bounces: int, seed: int) -> None:
    """Cycles on one core: few samples and bounces, then the denoiser."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    scene.render.use_persistent_data = True
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.seed = samples, seed % 2**31
    cycles.use_adaptive_sampling = False
    cycles.max_bounces, cycles.diffuse_bounces = bounces + 2, bounces
    cycles.glossy_bounces, cycles.transmission_bounces, cycles.transparent_max_bounces = 2, 2, 6
    cycles.caustics_reflective = cycles.caustics_refractive = False
    cycles.sample_clamp_indirect = 8.0
    cycles.blur_glossy = 1.0
    cycles.use_light_tree = True
    cycles.use_denoising = True
    cycles.denoiser = "OPENIMAGEDENOISE"
    cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL"
    cycles.denoising_prefilter = "FAST"
    scene.view_layers[0].use_pass_z = True
    scene.render.image_settings.media_type = "MULTI_LAYER_IMAGE"
    scene.render.image_settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.image_settings.color_depth = "32"
