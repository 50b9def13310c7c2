"""Which layers are laid behind the panorama's own."""

from dataclasses import dataclass

from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class PeelConfig(Settings):
    """Layers that are laid behind once, in the panorama's own view, before any path is taken."""

    room: bool = setting(True, "the room behind what stands in it, where it is a box; needs restore.method")
    outside: bool = setting(True, "what windows would show from beside the camera")
    lining: bool = setting(True, "a coarser copy right behind sharp surfaces, which have gaps for who comes near")
