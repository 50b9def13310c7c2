"""Lamps, the sun, daylight behind windows, and the surroundings that only the camera and mirrors see."""

import math
import os

import bpy


def add_light(record: dict) -> None:
    """A point, area or sun light."""
    kind = {"point": "POINT", "area": "AREA", "sun": "SUN"}[record["kind"]]
    data = bpy.data.lights.new(record["kind"], kind)
    data.color = record["colour"]
    data.energy = record["power"]
    light = bpy.data.objects.new(record["kind"], data)
    if kind == "POINT":
        data.shadow_soft_size = record["radius"]
    if kind == "AREA":
        data.shape = "RECTANGLE"
        data.size, data.size_y = record["size"]
    if kind == "SUN":
        data.angle = record["angle"]
    if kind != "POINT":
        light.rotation_euler = _facing(record["towards"])
    light.location = record.get("place", (0, 0, 50))
    light.visible_camera = light.visible_glossy = False
    bpy.context.scene.collection.objects.link(light)


def _facing(towards: list[float]) -> tuple[float, float, float]:
    """Euler angles that turn a lamp, which shines along its own -z, to shine along `towards`."""
    x, y, z = towards
    return math.acos(-z / math.hypot(x, y, z)), 0.0, math.atan2(-x, y)


def set_world(record: dict) -> None:
    """Blender's own photographed surroundings, seen by camera and glossy surfaces alone: windows carry the light."""
    world = bpy.data.worlds.get("surroundings") or bpy.data.worlds.new("surroundings")
    bpy.context.scene.world = world
    world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes.clear()
    picture = nodes.new("ShaderNodeTexEnvironment")
    picture.image = world_image(record["image"])
    place = nodes.new("ShaderNodeMapping")
    place.inputs["Rotation"].default_value = (0, 0, record["turn"])
    coordinates = nodes.new("ShaderNodeTexCoord")
    shine = nodes.new("ShaderNodeBackground")
    shine.inputs["Strength"].default_value = record["strength"]
    end = nodes.new("ShaderNodeOutputWorld")
    links.new(coordinates.outputs["Generated"], place.inputs["Vector"])
    links.new(place.outputs["Vector"], picture.inputs["Vector"])
    links.new(picture.outputs["Color"], shine.inputs["Color"])
    links.new(shine.outputs["Background"], end.inputs["Surface"])
    seen = world.cycles_visibility
    seen.camera, seen.glossy, seen.diffuse, seen.transmission, seen.scatter = True, True, False, True, False
    world.cycles.sampling_method = "NONE"


def world_image(name: str) -> bpy.types.Image:
    """One of the photographed surroundings that Blender ships."""
    folder = os.path.join(bpy.utils.resource_path("LOCAL"), "datafiles", "studiolights", "world")
    image = bpy.data.images.load(os.path.join(folder, f"{name}.exr"), check_existing=True)
    return image
