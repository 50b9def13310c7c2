"""The refinement's numbers; the defaults are the paper's (Table 3dgs_refine_details) where it gives one."""

from dataclasses import dataclass

from rein3d_jax.errors import InputError

DENSIFICATIONS = ("default", "mcmc")


@dataclass(frozen=True)
class RefineConfig:
    steps: int = 15_000
    batch: int = 4  # views a step
    devices: int = 1  # that share a step's views; 0 takes all
    panoramic: bool = False  # fit to whole panoramas weighed by solid angle, not to perspective views of them
    crop: int = 512  # pixels a side of a perspective view, or rows of a panorama
    fov: float = 90.0  # degrees; six of 90 tile the sphere
    test_every: int = 16  # every 16th view is held out
    evaluate_every: int = 5_000  # steps between looks at the held-out views
    sh_degree: int = 3
    sh_degree_every: int = 1_000  # steps before the next degree joins in (3DGS)
    # No Gaussian shrinks below this share of the size it was lifted with, a pixel's footprint: finer than the sampling
    # of what was observed is noise that shows from elsewhere (Mip-Splatting's 3D filter, Sec. 5.1). 0 turns it off.
    finest: float = 0.8
    ssim_weight: float = 0.2
    # Whether Gaussians on the surfaces that the input saw stay as they were lifted, and only guesses are refined:
    # fitting sharpens them to the input's own sampling, which costs up to 0.3 dB elsewhere (benchmarks/NOTES.md).
    keep_observed: bool = False
    observed_weight: float = 1.0  # of a pixel that the input saw
    restored_weight: float = 0.5  # of a pixel that was guessed
    distance_weight: float = 0.0  # of |log distance| off the input's, where the input saw
    opacity_weight: float = 0.0  # of the mean opacity; with "mcmc" its authors take 0.01
    scale_weight: float = 0.0  # of the mean scale, in extents; likewise 0.01
    # Rate of each trajectory's colour affine, so that guesses that disagree in tint do not blur each other; 0: none.
    colour_rate: float = 0.0
    means_rate: float = 1.6e-4  # times the scene's extent, decaying to means_rate_end of it
    means_rate_end: float = 0.01
    scales_rate: float = 5e-3
    opacities_rate: float = 5e-2
    quats_rate: float = 1e-3
    sh_rate: float = 2.5e-3
    sh_rest_rate: float = 1.25e-4
    steps_at_once: int = 1  # steps in one compiled scan; more spares an accelerator the waits between them
    plateau: float = 0.0  # dB; stop when `patience` looks in a row brought less. 0: never
    patience: int = 2
    densification: str = "default"  # clone and split by gradient (3DGS); or "mcmc", relocation under a hard cap
    noise: float = 5e5  # of "mcmc": steers exploration (Kheradmand et al. 2024, their noise_lr)
    spare: float = 1.0  # free slots for densification, as a share of the Gaussians it starts with
    densify_start: int = 500
    densify_stop: int = 13_000
    densify_every: int = 100
    densify_gradient: float = 2e-4  # mean 2D gradient, in half image widths, over which a Gaussian is cloned or split
    # Whether that gradient is a sum of lengths over pixels, in which opposite pulls do not cancel: what is large and
    # blurred then splits too (AbsGS, Ye et al. 2024, who take 8e-4 for densify_gradient with it).
    absolute_gradient: bool = False
    densify_share: float = 0.05  # of the buffer, at most, added at a time
    split_size: float = 0.01  # share of the extent over which a Gaussian is split, not cloned
    duplicates: int = 0  # times that pairs of near-duplicates are made one before it begins; see merge_duplicates.py
    needless: float = 0.0  # mean change of the views for which Gaussians are left out before it begins; see prune.py
    most: int = 0  # Gaussians, a budget: the ones that the views need least are left out, none grow beyond. 0: no limit
    prune_opacity: float = 0.005
    prune_size: float = 0.1  # share of the extent over which a Gaussian is pruned, after the first opacity reset
    reset_every: int = 3_000

    def __post_init__(self):
        for name in ("steps", "evaluate_every", "sh_degree_every", "densify_every", "reset_every",
                     "steps_at_once", "patience"):  # fmt: skip
            if getattr(self, name) < (0 if name == "steps" else 1):
                raise InputError(f"refine.{name} {getattr(self, name)} is too small")
        if self.densification not in DENSIFICATIONS:
            raise InputError(f'refine.densification "{self.densification}" must be one of {", ".join(DENSIFICATIONS)}')
        if self.crop < 16 or self.batch < 1 or self.test_every < 2:
            raise InputError("refine.crop must be at least 16, refine.batch at least 1, refine.test_every at least 2")
        if not 0 <= self.sh_degree <= 3:
            raise InputError(f"refine.sh_degree {self.sh_degree} must be 0, 1, 2 or 3")
        if not 10 <= self.fov <= 120:
            raise InputError(f"refine.fov {self.fov} must lie between 10 and 120 degrees")
