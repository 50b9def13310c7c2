"""How restored frames are made finer. Static under jit."""

from dataclasses import dataclass

from rein3d_jax.settings import Settings, setting

NONE, BICUBIC, LEARNED = "none", "bicubic", "learned"


@dataclass(frozen=True)
class UpsampleConfig(Settings):
    """The settings of restored frames' super-resolution, which doubles their rows."""

    method: str = setting(NONE, "that doubles the rows of restored frames", among=(NONE, BICUBIC, LEARNED))
    reference: bool = setting(True, "the input's own pixels where it saw the surface as fine; needs a method")
