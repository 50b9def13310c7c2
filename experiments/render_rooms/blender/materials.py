"""The plan's materials as Cycles nodes. Texture coordinates are metres on a face's plane."""

import bpy

from experiments.render_rooms.blender.lights import world_image


def make_material(name: str, spec: dict) -> bpy.types.Material:
    """A material from its small dictionary; `spec["kind"]` names one of the makers below."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    _MAKERS[spec["kind"]](material.node_tree, spec)
    return material


def principled_node(tree: bpy.types.NodeTree) -> bpy.types.Node:
    """The surface's main node."""
    return next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")


def _surface(tree: bpy.types.NodeTree, spec: dict) -> bpy.types.Node:
    surface = principled_node(tree)
    surface.inputs["Roughness"].default_value = spec.get("roughness", 0.6)
    surface.inputs["Specular IOR Level"].default_value = 0.35
    return surface


def _rgba(colour: list[float]) -> tuple[float, ...]:
    return (*colour, 1.0)


def _coordinates(tree: bpy.types.NodeTree, size: list[float], angle: float = 0.0) -> bpy.types.NodeSocket:
    """Texture coordinates in units of `size` metres."""
    metres = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, angle)
    mapping.inputs["Scale"].default_value = (1 / size[0], 1 / size[1], 1)
    tree.links.new(metres.outputs["UV"], mapping.inputs["Vector"])
    return mapping.outputs["Vector"]


def _plain(tree: bpy.types.NodeTree, spec: dict) -> None:
    _surface(tree, spec).inputs["Base Color"].default_value = _rgba(spec["colour"])


def _metal(tree: bpy.types.NodeTree, spec: dict) -> None:
    _plain(tree, spec)
    principled_node(tree).inputs["Metallic"].default_value = 0.9


def _photo(tree: bpy.types.NodeTree, spec: dict) -> None:
    surface = _surface(tree, spec)
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image = bpy.data.images.load(spec["path"], check_existing=True)
    recolour = tree.nodes.new("ShaderNodeHueSaturation")
    hue, saturation, value = spec["recolour"]
    recolour.inputs["Hue"].default_value = 0.5 + hue
    recolour.inputs["Saturation"].default_value = saturation
    recolour.inputs["Value"].default_value = value
    tree.links.new(_coordinates(tree, spec["size"], spec["angle"]), picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], recolour.inputs["Color"])
    tree.links.new(recolour.outputs["Color"], surface.inputs["Base Color"])


def _bricks(tree: bpy.types.NodeTree, spec: dict) -> None:
    """Tiles, planks or bricks: two colours that alternate by chance, joints between."""
    surface = _surface(tree, spec)
    tile = tree.nodes.new("ShaderNodeTexBrick")
    width, height = spec["size"]
    tile.offset = 0.0 if spec["kind"] == "tiles" else 0.5 if spec["kind"] == "brick" else 0.37
    tile.inputs["Color1"].default_value = _rgba(spec["colour"])
    tile.inputs["Color2"].default_value = _rgba(spec["second"])
    tile.inputs["Mortar"].default_value = _rgba(spec["mortar"])
    tile.inputs["Scale"].default_value = 1.0
    tile.inputs["Mortar Size"].default_value = {"tiles": 0.012, "brick": 0.06}.get(spec["kind"], 0.01)
    tile.inputs["Brick Width"].default_value = width / height
    tile.inputs["Row Height"].default_value = 1.0
    tree.links.new(_coordinates(tree, [height, height], spec["angle"]), tile.inputs["Vector"])
    tree.links.new(_grained(tree, tile.outputs["Color"], spec), surface.inputs["Base Color"])


def _grained(tree: bpy.types.NodeTree, colour: bpy.types.NodeSocket, spec: dict) -> bpy.types.NodeSocket:
    """`colour` with the grain of wood or the clouds of stone on it."""
    size = [0.6, 0.02] if spec["kind"] == "planks" else [0.15, 0.15]
    noise = _noise(tree, _coordinates(tree, size, spec["angle"]), 3.0, spec["seed"])
    mix = tree.nodes.new("ShaderNodeMix")
    mix.data_type, mix.blend_type = "RGBA", "SOFT_LIGHT"
    mix.inputs["Factor"].default_value = 0.7 if spec["kind"] == "planks" else 0.35
    tree.links.new(colour, mix.inputs["A"])
    tree.links.new(noise, mix.inputs["B"])
    return mix.outputs["Result"]


def _noise(tree: bpy.types.NodeTree, where: bpy.types.NodeSocket, detail: float, seed: float) -> bpy.types.NodeSocket:
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.noise_dimensions = "4D"
    noise.inputs["W"].default_value = seed
    noise.inputs["Scale"].default_value = 1.0
    noise.inputs["Detail"].default_value = detail
    tree.links.new(where, noise.inputs["Vector"])
    return noise.outputs["Fac"]


def _speckled(tree: bpy.types.NodeTree, spec: dict) -> None:
    """Carpet, plaster, terrazzo: noise between two colours."""
    surface = _surface(tree, spec)
    ramp = _ramp(tree, [spec["colour"], spec["second"]])
    size, detail = {"carpet": ([0.012, 0.012], 2.0), "plaster": ([0.35, 0.35], 5.0)}.get(
        spec["kind"], ([0.03, 0.03], 1.0)
    )
    tree.links.new(_noise(tree, _coordinates(tree, size), detail, spec["seed"]), ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], surface.inputs["Base Color"])
    if spec["kind"] == "carpet":
        surface.inputs["Roughness"].default_value = 1.0


def _stripes(tree: bpy.types.NodeTree, spec: dict) -> None:
    surface = _surface(tree, spec)
    wave = tree.nodes.new("ShaderNodeTexWave")
    wave.bands_direction = "X"
    wave.inputs["Scale"].default_value = 0.314
    ramp = _ramp(tree, [spec["colour"], spec["second"]])
    ramp.color_ramp.interpolation = "CONSTANT"
    tree.links.new(_coordinates(tree, [spec["size"][0], 1.0]), wave.inputs["Vector"])
    tree.links.new(wave.outputs["Fac"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], surface.inputs["Base Color"])


def _ramp(tree: bpy.types.NodeTree, colours: list[list[float]]) -> bpy.types.Node:
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    stops = ramp.color_ramp.elements
    while len(stops) < len(colours):
        stops.new(0.5)
    for number, colour in enumerate(colours):
        stops[number].position = 0.3 + 0.4 * number / max(len(colours) - 1, 1)
        stops[number].color = _rgba(colour)
    return ramp


def _abstract(tree: bpy.types.NodeTree, spec: dict) -> None:
    surface = _surface(tree, spec)
    kind = {"voronoi": "Voronoi", "noise": "Noise", "wave": "Wave", "magic": "Magic"}[spec["pattern"]]
    pattern = tree.nodes.new(f"ShaderNodeTex{kind}")
    pattern.inputs["Scale"].default_value = spec["scale"]
    ramp = _ramp(tree, spec["colours"])
    ramp.color_ramp.interpolation = "CONSTANT"
    output = pattern.outputs["Distance"] if kind == "Voronoi" else pattern.outputs["Fac"]
    tree.links.new(_coordinates(tree, [1.0, 1.0]), pattern.inputs["Vector"])
    tree.links.new(output, ramp.inputs["Fac"])
    tree.links.new(ramp.outputs["Color"], surface.inputs["Base Color"])


def _photograph(tree: bpy.types.NodeTree, spec: dict) -> None:
    """A cut of a photographed surrounding; bright skies are held below white."""
    surface = _surface(tree, spec | {"roughness": 0.4})
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image = world_image(spec["world"])
    metres = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Location"].default_value = (*spec["corner"], 0)
    mapping.inputs["Scale"].default_value = (spec["share"], spec["share"], 1)
    limit = tree.nodes.new("ShaderNodeMix")
    limit.data_type, limit.blend_type, limit.clamp_result = "RGBA", "MULTIPLY", True
    limit.inputs["Factor"].default_value = 1.0
    limit.inputs["B"].default_value = (0.8, 0.8, 0.8, 1)
    tree.links.new(metres.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], limit.inputs["A"])
    tree.links.new(limit.outputs["Result"], surface.inputs["Base Color"])


def _mirror(tree: bpy.types.NodeTree, spec: dict) -> None:
    surface = principled_node(tree)
    surface.inputs["Base Color"].default_value = (0.85, 0.86, 0.86, 1)
    surface.inputs["Metallic"].default_value = 1.0
    surface.inputs["Roughness"].default_value = 0.02


def _lit(tree: bpy.types.NodeTree, spec: dict) -> None:
    surface = principled_node(tree)
    surface.inputs["Base Color"].default_value = (0.8, 0.8, 0.8, 1)
    surface.inputs["Emission Color"].default_value = _rgba(spec["colour"])
    surface.inputs["Emission Strength"].default_value = spec["strength"]


_MAKERS = {
    "plain": _plain, "metal": _metal, "photo": _photo, "tiles": _bricks, "planks": _bricks, "brick": _bricks,
    "carpet": _speckled, "plaster": _speckled, "terrazzo": _speckled, "stripes": _stripes, "abstract": _abstract,
    "photograph": _photograph, "mirror": _mirror, "lit": _lit,
}  # fmt: skip
