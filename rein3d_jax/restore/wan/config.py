"""Sizes and switches of the full-size network.

The defaults are Wan2.1-VACE-1.3B (Wan 2025; VACE 2025). One code path serves every size.
"""

from dataclasses import dataclass

from rein3d_jax.errors import InputError
from rein3d_jax.settings import Settings, setting

_DTYPES = ("float32", "bfloat16", "float64")  # the last for comparisons, under jax.enable_x64
_KERNELS = ("chunked", "xla", "cudnn")
_SIZE = "[1, inf)"


@dataclass(frozen=True)
class DitConfig(Settings):
    """Sizes and switches of the diffusion transformer."""

    heads: int = setting(12, "of the attention", within=_SIZE)
    head_dim: int = setting(128, "channels of a head, an even number: RoPE rotates pairs on 3 axes", within="[6, inf)")
    ffn: int = setting(8960, "channels of a block's hidden layer", within=_SIZE)
    depth: int = setting(30, "main blocks", within=_SIZE)
    control_every: int = setting(2, "main blocks from one control hint to the next; 0: no control", within="[0, inf)")
    channels: int = setting(16, "of the latents", within=_SIZE)
    control_channels: int = setting(96, "of the control's latents", within=_SIZE)
    text_dim: int = setting(4096, "channels of the embedded text", within=_SIZE)
    frequencies: int = setting(256, "of the embedded timestep, an even number", within="[2, inf)")
    patch: tuple[int, int, int] = setting((1, 2, 2), "latents of a token in time, height and width", within=_SIZE)
    epsilon: float = setting(1e-6, "of the norms", within="(0, inf)")
    circular: bool = setting(False, "width RoPE of integer harmonics: a yaw of whole tokens becomes an exact symmetry")
    dtype: str = setting("bfloat16", "of large matrix products; norms, modulation, rotation: float32", among=_DTYPES)
    param_dtype: str = setting("float32", "of the parameters", among=_DTYPES)
    remat: bool = setting(False, "recompute each block in the backward pass, for memory")
    kernel: str = setting("chunked", "attention; chunked runs anywhere, cudnn in bfloat16 on NVIDIA's", among=_KERNELS)
    query_chunk: int = setting(1024, "queries at once in the chunked attention", within=_SIZE)

    def __post_init__(self):
        super().__post_init__()
        if self.control_every and self.depth % self.control_every:
            raise InputError(f"depth must be a multiple of control_every ({self.control_every}), not {self.depth}")
        if self.head_dim % 2 or self.frequencies % 2:
            raise InputError(f"head_dim and frequencies must be even, not {self.head_dim} and {self.frequencies}")

    @property
    def width(self) -> int:
        """Channels of a token."""
        return self.heads * self.head_dim

    @property
    def group(self) -> int:
        """Main blocks in one step of the scan over depth."""
        return self.control_every or 1


@dataclass(frozen=True)
class VaeConfig(Settings):
    """Sizes and switches of the VAE."""

    base: int = setting(96, "channels at full resolution", within=_SIZE)
    multipliers: tuple[int, ...] = setting((1, 2, 4, 4), "channels of each stage over the base", within=_SIZE)
    blocks: int = setting(2, "residual blocks a stage in the encoder; the decoder has one more", within=_SIZE)
    halve_time: tuple[bool, ...] = setting((False, True, True), "whether the encoder's downsamplings halve time")
    circular: bool = setting(False, "pad the width with the other edge: exactly yaw-equivariant")
    dtype: str = setting("float32", "of the convolutions", among=_DTYPES)
    param_dtype: str = setting("float32", "of the parameters", among=_DTYPES)

    def __post_init__(self):
        super().__post_init__()
        if len(self.halve_time) != len(self.multipliers) - 1:
            raise InputError(
                f"halve_time must have {len(self.multipliers) - 1} entries, one a downsampling, not {self.halve_time}"
            )

    @property
    def stride(self) -> int:
        """Pixels a latent, on each side."""
        return 2 ** len(self.halve_time)

    @property
    def time_stride(self) -> int:
        """Frames a latent; the first frame has a latent of its own."""
        return 2 ** sum(self.halve_time)


@dataclass(frozen=True)
class WanConfig(Settings):
    """The full-size network: a diffusion transformer over the latents of a VAE."""

    dit: DitConfig = DitConfig()
    vae: VaeConfig = VaeConfig()


TINY = WanConfig(
    DitConfig(heads=2, head_dim=12, ffn=32, depth=4, text_dim=32, frequencies=32, dtype="float32"),
    VaeConfig(base=4, multipliers=(1, 1, 1, 1), blocks=1),
)
SMALL = WanConfig(
    DitConfig(heads=6, head_dim=64, ffn=1536, depth=12, text_dim=64), VaeConfig(base=32, multipliers=(1, 2, 4, 4))
)
