"""Furniture: an OBJ is loaded once a process, fitted into its catalog's size, and shared by all its copies."""

import os
import re

import bpy
import numpy as np

from experiments.render_rooms.blender.materials import principled_node

_FROM_OBJ = np.array(
    [[1, 0, 0], [0, 0, -1], [0, 1, 0]], float
)  # OBJ is y up, its front +z; here z is up, fronts are -y


def place_model(record: dict) -> None:
    """Put a planned model into the scene."""
    mesh = bpy.data.meshes.get(record["key"]) or _load(record)
    thing = bpy.data.objects.new(record["key"], mesh)
    thing.location = record["place"]
    thing.rotation_euler = (0, 0, record["yaw"])
    thing["part"], thing["model"] = "furniture", True
    thing.scale = [now / full for now, full in zip(record["size"], record["full_size"], strict=True)]
    bpy.context.scene.collection.objects.link(thing)
    for material in mesh.materials:
        _recolour(material, record["recolour"])


def _load(record: dict) -> bpy.types.Mesh:
    before = set(bpy.data.objects)
    bpy.ops.wm.obj_import(filepath=record["path"], forward_axis="NEGATIVE_Z", up_axis="Y", use_split_objects=False)
    loaded = next(thing for thing in bpy.data.objects if thing not in before)
    mesh = loaded.data
    bpy.data.objects.remove(loaded)
    mesh.name, mesh.use_fake_user = record["key"], True
    _fit(mesh, record)
    tints = _diffuse_colours(record["path"])
    for material in mesh.materials:
        if material is not None:
            material.use_fake_user = True
            _prepare(material, tints.get(re.sub(r"\.\d{3}$", "", material.name)))
    return mesh


def _fit(mesh: bpy.types.Mesh, record: dict) -> None:
    """Turn by the catalog's rotation and z up, then scale and shift into width, depth, height with the foot at 0.

    The importer leaves the mesh in the OBJ's axes and turns the object, which is not used here."""
    points = np.zeros(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    points = points.reshape(-1, 3)
    turn = np.array(record["rotation"] or np.eye(3)).reshape(3, 3)
    points = points @ (_FROM_OBJ @ turn).T
    low, high = points.min(0), points.max(0)
    size = np.array(record["full_size"])
    points = (points - low) / np.maximum(high - low, 1e-6) * size - np.array([size[0] / 2, size[1] / 2, 0])
    mesh.vertices.foreach_set("co", points.astype(np.float32).ravel())
    mesh.update()


def _diffuse_colours(path: str) -> dict[str, tuple[float, ...]]:
    """The MTL's diffuse colours by material: Blender drops them where there is a texture, viewers multiply them."""
    colours, name = {}, ""
    mtl = os.path.splitext(path)[0] + ".mtl"
    with open(mtl, encoding="latin1") as file:
        for line in file:
            words = line.split()
            if words[:1] == ["newmtl"]:
                name = " ".join(words[1:])
            elif words[:1] == ["Kd"]:
                colours[name] = tuple(map(float, words[1:4]))
    return colours


def _prepare(material: bpy.types.Material, tint: tuple[float, ...] | None) -> None:
    """Tame highlights, tint textures, and put a node for recolouring before the base colour."""
    tree = material.node_tree
    surface = principled_node(tree)
    surface.inputs["Roughness"].default_value = max(surface.inputs["Roughness"].default_value, 0.3)
    surface.inputs["Specular IOR Level"].default_value = min(surface.inputs["Specular IOR Level"].default_value, 0.5)
    surface.inputs["Metallic"].default_value = 0.0
    surface.inputs["Emission Strength"].default_value = 0.0  # some MTLs glow; lamps have lights of their own
    colour = surface.inputs["Base Color"]
    recolour = tree.nodes.new("ShaderNodeHueSaturation")
    recolour.name = "recolour"
    if colour.links and _is_loaded(colour.links[0].from_node):
        source = colour.links[0].from_socket
        tree.links.new(_tinted(tree, source, tint), recolour.inputs["Color"])
    else:
        plain = (*tint, 1) if tint else colour.default_value
        recolour.inputs["Color"].default_value = [min(max(c, 0.015), 0.85) for c in plain]
    tree.links.new(recolour.outputs["Color"], colour)


def _is_loaded(node: bpy.types.Node) -> bool:
    """Some catalogs' MTLs name pictures that are not there."""
    image = getattr(node, "image", None)
    return image is None or os.path.exists(bpy.path.abspath(image.filepath))


def _tinted(tree: bpy.types.NodeTree, source: bpy.types.NodeSocket, tint: tuple | None) -> bpy.types.NodeSocket:
    if not tint or max(tint) < 0.05:
        return source
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "MULTIPLY"
    mix.inputs["Factor"].default_value = 1.0
    mix.inputs["B"].default_value = (*(0.9 * c / max(tint) for c in tint), 1)
    tree.links.new(source, mix.inputs["A"])
    return mix.outputs["Result"]


def _recolour(material: bpy.types.Material | None, recolour: list[float]) -> None:
    node = material and material.node_tree.nodes.get("recolour")
    if node:
        node.inputs["Hue"].default_value = (0.5 + recolour[0]) % 1.0
        node.inputs["Saturation"].default_value = recolour[1]
        node.inputs["Value"].default_value = recolour[2]
