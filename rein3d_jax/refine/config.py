"""Settings of the refinement; the defaults are the paper's (Table 3dgs_refine_details) where it gives one."""

from dataclasses import dataclass

from rein3d_jax.settings import Settings, setting

_SHARE, _POSITIVE = "[0, 1]", "[0, inf)"


@dataclass(frozen=True)
class ViewsConfig(Settings):
    """The perspective views that a scene is fitted to, cut out of panoramas."""

    size: int = setting(512, "side of a view", within="[16, 4096]", unit="pixels")
    fov: float = setting(90.0, "of a view; six of 90 tile the sphere", within="[10, 120]", unit="degrees")
    held_out_every: int = setting(16, "every so many-th view is not trained on, but evaluated", within="[2, inf)")


@dataclass(frozen=True)
class PhotometricConfig(Settings):
    """The loss of a view: trust x ((1 - ssim) L1 + ssim D-SSIM), and regularisers."""

    ssim: float = setting(0.2, "share of D-SSIM (3DGS)", within=_SHARE)
    observed: float = setting(1.0, "trust in a pixel that the input saw", within=_POSITIVE)
    restored: float = setting(0.5, "trust in a pixel that was guessed", within=_POSITIVE)
    opacity: float = setting(0.0, "weight of the mean opacity; with mcmc its authors take 0.01", within=_POSITIVE)
    scale: float = setting(0.0, "weight of the mean scale, in extents; likewise 0.01", within=_POSITIVE)


@dataclass(frozen=True)
class RatesConfig(Settings):
    """Adam's learning rate for each kind of parameter."""

    means: float = setting(1.6e-4, "times the scene's extent, decaying to means_end of it", within=_POSITIVE)
    means_end: float = setting(0.01, "share of means' rate at the last step", within="(0, 1]")
    scales: float = setting(5e-3, "of log scales", within=_POSITIVE)
    opacities: float = setting(5e-2, "of opacity logits", within=_POSITIVE)
    quats: float = setting(1e-3, "of quaternions", within=_POSITIVE)
    sh: float = setting(2.5e-3, "of colour (degree 0)", within=_POSITIVE)
    sh_rest: float = setting(1.25e-4, "of higher harmonics", within=_POSITIVE)


@dataclass(frozen=True)
class DensifyConfig(Settings):
    """When and where Gaussians are added and taken away."""

    start: int = setting(500, "first step at which it may happen", within=_POSITIVE)
    stop: int = setting(13_000, "step from which it no longer happens", within=_POSITIVE)
    every: int = setting(100, "steps between two times", within="[1, inf)")
    gradient: float = setting(
        2e-4, "mean means2d gradient over which one is cloned or split", within=_POSITIVE, unit="half image widths"
    )
    share: float = setting(0.05, "of the buffer, at most, added at a time", within="(0, 1]")
    split_size: float = setting(0.01, "share of the extent over which one is split, not cloned", within=_POSITIVE)
    prune_opacity: float = setting(0.005, "opacity under which a Gaussian is pruned", within="(0, 1)")
    prune_size: float = setting(0.1, "share of the extent over which it is pruned, after a reset", within="(0, inf)")
    reset_every: int = setting(3_000, "steps between opacity resets (default densification)", within="[1, inf)")
    noise: float = setting(5e5, "of mcmc: how far means wander (Kheradmand et al. 2024, noise_lr)", within=_POSITIVE)


@dataclass(frozen=True)
class RefineConfig(Settings):
    """Fitting the scene to views of the input and of the restored panoramas."""

    steps: int = setting(15_000, "of the optimizer", within=_POSITIVE)
    batch: int = setting(4, "views a step", within="[1, inf)")
    devices: int = setting(1, "that share a step's views; 0 takes all", within=_POSITIVE)
    evaluate_every: int = setting(5_000, "steps between held-out evaluations", within="[1, inf)")
    plateau: float = setting(
        0.0, "stop when `patience` evaluations in a row brought less; 0: never", within=_POSITIVE, unit="dB"
    )
    patience: int = setting(2, "evaluations that must bring too little", within="[1, inf)")
    sh_degree: int = setting(3, "of the harmonics of colour", within="[0, 3]")
    sh_degree_every: int = setting(1_000, "steps before the next degree joins in (3DGS)", within="[1, inf)")
    # Finer than the sampling of what was observed is noise that shows from elsewhere (Mip-Splatting, Sec. 5.1).
    min_scale: float = setting(0.8, "share of the size it was lifted with below which none shrinks", within=_POSITIVE)
    # Fitting sharpens what was seen to the input's own sampling, which costs up to 0.3 dB elsewhere.
    freeze_observed: bool = setting(False, "whether what the input saw stays as it was lifted")
    max_count: int = setting(0, "Gaussians: more are thinned evenly, and the rest grown; 0: no limit", within=_POSITIVE)
    spare: float = setting(1.0, "free slots, as a share of the Gaussians it starts with", within=_POSITIVE)
    densification: str = setting(
        "default", "clone and split (3DGS); mcmc: relocation under a hard cap", among=("none", "default", "mcmc")
    )
    densify: DensifyConfig = DensifyConfig()
    views: ViewsConfig = ViewsConfig()
    loss: PhotometricConfig = PhotometricConfig()
    rates: RatesConfig = RatesConfig()
