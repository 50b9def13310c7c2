"""How a panorama becomes Gaussians. Static under jit."""

from dataclasses import dataclass

from rein3d_jax.settings import Settings, setting


@dataclass(frozen=True)
class LiftConfig(Settings):
    """The lift's settings."""

    capacity: int = setting(0, "slots for Gaussians; 0: as many as it takes", within="[0, inf)")
    opacity: float = setting(0.99, "opacity of every Gaussian", within="(0, 1)")
    footprint: float = setting(0.75, "sigma over half a pixel's diagonal where there is detail", within="(0, inf)")
    plain_footprint: float = setting(1.15, "the same where the picture is plain", within="(0, inf)")
    sharpen: float = setting(0.75, "share of what splats blur away that their colours make up for", within="[0, inf)")
    steepest: float = setting(6.0, "tangent of incidence up to which splats are stretched; 0: never", within="[0, inf)")
    thickness: float = setting(0.3, "a splat's extent across its surface, over its width", within="(0, inf)")
    share: float = setting(1.0, "Gaussians for each pixel at most, larger ones where it is smooth", within="(0, 1]")
    # The next three are for a share below 1; beside a step of the fourth splats are narrow, too.
    worth: float = setting(
        0.0, "sum over pixels of the error in sRGB that one Gaussian more has to spare; 0: any", within="[0, inf)"
    )
    max_leaf_side: int = setting(16, "side of what one Gaussian stands for at most", within="[1, inf)", unit="pixels")
    flatness: float = setting(0.003, "relative distance of a surface from its Gaussian's plane", within="[0, inf)")
    leaf_step: float = setting(0.05, "relative step of inverse distance that no Gaussian spans", within="[0, inf)")
    snap_edges: bool = setting(True, "make the blurred ramps of a distance map's edges steps again")
    # At 256 x 512, 24 links hold a step blurred by a Gaussian of 3 pixels (4 % of the pixels off both surfaces before,
    # none after; with 16 links still 4 %). The price on exact, furnished rooms of that size: 1.2 % of the pixels move
    # by more than 2 % (faces seen nearly edge-on); 1.0 % with 16 links.
    edge_ramp: int = setting(24, "width of the widest ramp that is made a step", within="[1, inf)", unit="pixels")
    edge_step: float = setting(0.1, "relative change of distance across an edge, at least", within="[0, inf)")
    edge_slope: float = setting(0.01, "relative change per pixel of the surfaces beside a ramp", within="[0, inf)")
