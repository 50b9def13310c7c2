"""One room from its plan: build it, take its panoramas, write them."""

import json
import os
import time

import bpy
import numpy as np

from experiments.render_rooms.blender.camera import set_camera, set_render
from experiments.render_rooms.blender.exits import cast_exits
from experiments.render_rooms.blender.lights import add_light, set_world
from experiments.render_rooms.blender.materials import make_material
from experiments.render_rooms.blender.models import place_model
from experiments.render_rooms.blender.pictures import develop, exposure_gains, render_view, write_picture

_RAYS_ON_PLANE = 0.7  # a face whose normal leans more than this upwards is textured from above


def draw_room(plan: dict, folder: str, settings: dict) -> int:
    """Render `plan` into `folder` with settings["samples"], settings["bounces"]; returns the number of panoramas."""
    empty_scene()
    build_room(plan)
    set_render(settings["samples"], settings["bounces"], plan["seed"])
    os.makedirs(folder, exist_ok=True)
    walk_gains = None
    for panorama in plan["panoramas"]:
        keep = walk_gains if panorama["name"].startswith("walk") else None
        gains = _take(panorama, plan["look"], os.path.join(folder, panorama["name"]), keep)
        walk_gains = walk_gains or gains  # a walk keeps the first panorama's exposure
    _write_record(plan, folder)
    return len(plan["panoramas"])


def draw_emptied(plan: dict, folder: str, settings: dict) -> int:
    """The panoramas of `plan` again, as settings["emptied"] lists it: "exit" casts the rays of KKK_exit.npz, "empty"
    renders KKK_empty, where the camera looks through the furniture, and light and shadows stay. settings["furnished"]
    is the folder of the finished room.

    What lies flat on floor or wall is not drawn at all: no light would reach the surface below it. The pictures are
    developed with the `gains` that each panorama brings, so they fit the furnished ones."""
    empty_scene()
    build_room(plan)
    os.makedirs(folder, exist_ok=True)
    if "exit" in settings["emptied"]:
        _write_exits(plan, folder, settings["furnished"])
    if "empty" in settings["emptied"]:
        _draw_without_furniture(plan, folder, settings)
    return len(plan["panoramas"])


def _write_exits(plan: dict, folder: str, furnished: str) -> None:
    for panorama in plan["panoramas"]:
        distance = np.load(os.path.join(furnished, panorama["name"] + ".npz"))["distance"]
        leave = cast_exits(panorama, distance)["exit"]
        np.savez_compressed(os.path.join(folder, panorama["name"] + "_exit.npz"), exit=leave)


def _draw_without_furniture(plan: dict, folder: str, settings: dict) -> None:
    for thing in bpy.context.scene.objects:
        thing.visible_camera = thing.visible_camera and thing.get("part") != "furniture"
        thing.hide_render = thing.get("part") == "flat"
    set_render(settings["samples"], settings["bounces"], plan["seed"])
    for panorama in plan["panoramas"]:
        _take(panorama, plan["look"], os.path.join(folder, panorama["name"] + "_empty"), panorama["gains"])


def _take(panorama: dict, look: dict, stem: str, gains: tuple | None) -> tuple:
    """Render one panorama to `stem`.png and `stem`.npz; returns the gains used."""
    began = time.process_time()
    set_camera(panorama)
    linear, distance = render_view()
    gains = gains or exposure_gains(linear, look)
    picture, linear = develop(linear, gains, look)
    write_picture(picture, stem + ".png")
    np.savez_compressed(stem + ".npz", distance=distance.astype(np.float32), linear=linear.astype(np.float16))
    panorama["seconds"] = round(time.process_time() - began, 2)
    panorama["gains"] = [float(gain) for gain in gains]
    return gains


def empty_scene() -> None:
    """Take away the last room; models stay loaded."""
    for thing in list(bpy.data.objects):
        bpy.data.objects.remove(thing, do_unlink=True)
    for collection in (bpy.data.meshes, bpy.data.lights, bpy.data.cameras, bpy.data.materials):
        for block in list(collection):
            if block.users == 0:
                collection.remove(block)


def build_room(plan: dict) -> None:
    """All of a plan's faces, models, lights and its world."""
    grouped: dict[tuple[str, str], list] = {}
    for face in plan["faces"]:
        grouped.setdefault((face["material"], face["part"]), []).append(face["corners"])
    materials = {name: make_material(name, plan["materials"][name]) for name in {name: None for name, _ in grouped}}
    for (name, part), faces in grouped.items():
        _add_faces(name, faces, materials[name])["part"] = part
    for record in plan["models"]:
        place_model(record)
    for light in plan["lights"]:
        add_light(light)
    set_world(plan["world"])


def _add_faces(name: str, faces: list, material: bpy.types.Material) -> bpy.types.Object:
    """One mesh of faces of a material, with metres as texture coordinates."""
    mesh = bpy.data.meshes.new(name)
    corners = [corner for face in faces for corner in face]
    ends = np.cumsum([len(face) for face in faces])
    mesh.from_pydata(corners, [], [list(range(end - len(face), end)) for end, face in zip(ends, faces, strict=True)])
    layer = mesh.uv_layers.new()
    uv = np.concatenate([_metres_on_plane(np.array(face)) for face in faces])
    loops = np.zeros(len(mesh.loops), np.int32)
    mesh.loops.foreach_get("vertex_index", loops)
    layer.data.foreach_set("uv", uv[loops].astype(np.float32).ravel())
    if name.startswith(("picture", "mirror")) and name != "picture_frame":
        layer.data.foreach_set("uv", np.array([[[1, 0], [0, 0], [0, 1], [1, 1]]] * len(faces), np.float32).ravel())
    mesh.materials.append(material)
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    return thing


def _metres_on_plane(corners: np.ndarray) -> np.ndarray:
    normal = np.sum(np.cross(corners, np.roll(corners, -1, axis=0)), axis=0)
    normal = normal / (np.linalg.norm(normal) + 1e-12)
    if abs(normal[2]) > _RAYS_ON_PLANE:
        return corners[:, :2]
    along = np.array([-normal[1], normal[0]]) / np.hypot(normal[0], normal[1])
    return np.stack([corners[:, :2] @ along, corners[:, 2]], axis=1)


def _write_record(plan: dict, folder: str) -> None:
    """The room's JSON, without the faces that only Blender needs."""
    with open(os.path.join(folder, "room.json"), "w") as file:
        json.dump({key: value for key, value in plan.items() if key != "faces"}, file, indent=1)
