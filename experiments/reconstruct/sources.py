"""Whose pictures a run shows, and under which licence, in sentences for its report."""

from pathlib import Path

from experiments.reconstruct.inputs import resolve
from rein3d_jax.io.pictures.decode import read_credit

# What samples/SOURCES.md says, by the sample's first folder or file.
SAMPLES = {
    "room": (
        "The room was rendered with Blender Cycles. Furniture: Sweet Home 3D libraries by Scopia (CC-BY 3.0), "
        "BlendSwap-CC-BY (CC-BY 3.0), KatorLegaz (CC-BY 3.0 US) and BlendSwap-CC-0 (CC0). Floor and wall textures: "
        "Sweet Home 3D. Sky: Blender studio lights (CC0). The furniture was placed in a room and rendered.",
    ),
    "hotel_room.jpg": ("hotel_room by Poly Haven, CC0, by way of Blender's studio lights; tone-mapped.",),
}


def sources(panorama: str) -> tuple[str, ...]:
    """Sentences on the input named `panorama` in a recipe."""
    if panorama.startswith("sample:"):
        name = panorama.removeprefix("sample:").partition("/")[0]
        return (*SAMPLES.get(name, ()), "The whole list is in experiments/samples/SOURCES.md.")
    credit = read_credit(resolve(panorama)) if resolve(panorama).is_file() else ""
    said = f"The file says: {credit}." if credit else "The file names no author and no licence."
    return (f"The panorama is your own picture, {Path(panorama).name}. {said} Everything shown here derives from it.",)
