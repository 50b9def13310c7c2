"""Whose pictures a run shows, and under which licence, in sentences for its report."""

import tomllib
from pathlib import Path

from experiments.reconstruct.inputs import SAMPLES, resolve
from rein3d_jax.io.pictures.decode import read_credit


def sources(panorama: str) -> tuple[str, ...]:
    """Sentences on the input named `panorama` in a recipe: samples/credits.toml's by the sample's first folder or file,
    or what the picture's own header says."""
    if panorama.startswith("sample:"):
        name = panorama.removeprefix("sample:").partition("/")[0]
        credits = tomllib.loads((SAMPLES / "credits.toml").read_text("utf-8"))
        return (credits[name],) if name in credits else ()
    credit = read_credit(resolve(panorama)) if resolve(panorama).is_file() else ""
    said = f"The file says: {credit}." if credit else "The file names no author and no licence."
    return (f"The panorama is your own picture, {Path(panorama).name}. {said} Everything shown here derives from it.",)
