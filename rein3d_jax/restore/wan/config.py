"""Sizes and switches of the full-size network, as frozen configs; a preset is a config with a name.

The defaults are Wan2.1-VACE-1.3B (Wan 2025; VACE 2025). One code path serves every size.
"""

from dataclasses import dataclass, field

from rein3d_jax.errors import InputError

DTYPES = ("float32", "bfloat16", "float64")  # the last for comparisons, under jax.enable_x64
KERNELS = ("chunked", "xla", "cudnn")


def _check(part: str, *dtypes: str) -> None:
    for dtype in dtypes:
        if dtype not in DTYPES:
            raise InputError(f'{part} dtype "{dtype}" is unknown; choose one of {", ".join(DTYPES)}')


@dataclass(frozen=True)
class DitConfig:
    heads: int = 12
    head_dim: int = 128
    ffn: int = 8960
    depth: int = 30  # main blocks
    control_every: int = 2  # main blocks from one control hint to the next, the first at block 0; 0 for no control
    channels: int = 16  # of the latents
    control_channels: int = 96
    text_dim: int = 4096
    frequencies: int = 256  # of the embedded timestep
    patch: tuple[int, int, int] = (1, 2, 2)
    epsilon: float = 1e-6
    circular: bool = False  # width RoPE of integer harmonics: a yaw of whole tokens becomes an exact symmetry
    dtype: str = "bfloat16"  # of the large matrix products; norms, modulation and rotation stay in float32
    param_dtype: str = "float32"
    remat: bool = False  # recompute each block in the backward pass
    kernel: str = "chunked"  # chunked runs anywhere; cudnn is the fused kernel of NVIDIA devices, bfloat16 alone
    query_chunk: int = 1024  # queries at once in the chunked attention

    def __post_init__(self):
        if self.control_every and self.depth % self.control_every:
            raise InputError(f"dit.depth {self.depth} must be a multiple of dit.control_every {self.control_every}")
        if self.head_dim % 2 or self.head_dim < 6:
            raise InputError(f"dit.head_dim {self.head_dim} must be even and at least 6: RoPE turns pairs on 3 axes")
        _check("dit", self.dtype, self.param_dtype)
        if self.kernel not in KERNELS:
            raise InputError(f'dit.kernel "{self.kernel}" is unknown; choose one of {", ".join(KERNELS)}')

    @property
    def width(self) -> int:
        return self.heads * self.head_dim

    @property
    def group(self) -> int:
        """Main blocks in one step of the scan over depth."""
        return self.control_every or 1


@dataclass(frozen=True)
class VaeConfig:
    base: int = 96
    multipliers: tuple[int, ...] = (1, 2, 4, 4)
    blocks: int = 2  # residual blocks a stage in the encoder; the decoder has one more
    halve_time: tuple[bool, ...] = (False, True, True)  # at each of the encoder's downsamplings
    circular: bool = False  # pad the width with the other edge: exactly yaw-equivariant
    dtype: str = "float32"
    param_dtype: str = "float32"

    def __post_init__(self):
        if len(self.halve_time) != len(self.multipliers) - 1:
            raise InputError(f"vae.halve_time needs {len(self.multipliers) - 1} entries, one a downsampling")
        _check("vae", self.dtype, self.param_dtype)

    @property
    def stride(self) -> int:
        """Pixels a latent, on each side."""
        return 2 ** len(self.halve_time)

    @property
    def time_stride(self) -> int:
        """Frames a latent; the first frame has a latent of its own."""
        return 2 ** sum(self.halve_time)


@dataclass(frozen=True)
class WanConfig:
    dit: DitConfig = field(default_factory=DitConfig)
    vae: VaeConfig = field(default_factory=VaeConfig)


TINY = WanConfig(
    DitConfig(heads=2, head_dim=12, ffn=32, depth=4, text_dim=32, frequencies=32, dtype="float32"),
    VaeConfig(base=4, multipliers=(1, 1, 1, 1), blocks=1),
)
SMALL = WanConfig(
    DitConfig(heads=6, head_dim=64, ffn=1536, depth=12, text_dim=64), VaeConfig(base=32, multipliers=(1, 2, 4, 4))
)
PRESETS = {"tiny": TINY, "small": SMALL, "wan2.1-vace-1.3b": WanConfig()}


def preset(name: str) -> WanConfig:
    """The config called `name`. Raises InputError if there is none."""
    if name not in PRESETS:
        raise InputError(f'preset "{name}" is unknown; choose one of {", ".join(PRESETS)}')
    return PRESETS[name]
