"""Gaussians as a dict of optimised leaves, each with its own rate, and back."""

import jax
import jax.numpy as jnp
import optax

from rein3d_jax.refine.config import RefineConfig
from rein3d_jax.scene import Gaussians


def split_parameters(gaussians: Gaussians) -> dict[str, jax.Array]:
    """The float leaves; spherical harmonics apart by degree 0 and the rest, as their rates differ."""
    return {
        "means": gaussians.means,
        "log_scales": gaussians.log_scales,
        "quats": gaussians.quats,
        "opacity_logits": gaussians.opacity_logits,
        "sh": gaussians.sh[:, :1],
        "sh_rest": gaussians.sh[:, 1:],
    }


@jax.jit
def join_parameters(parameters: dict[str, jax.Array], alive: jax.Array) -> Gaussians:
    """Inverse of `split_parameters`."""
    names = ("means", "log_scales", "quats", "opacity_logits")
    sh = jnp.concatenate([parameters["sh"], parameters["sh_rest"]], axis=1)
    return Gaussians(*(parameters[name] for name in names), sh, alive)


def with_sh_degree(gaussians: Gaussians, degree: int) -> Gaussians:
    """The same scene with room for harmonics up to `degree`; new coefficients are 0."""
    count = (degree + 1) ** 2
    missing = max(count - gaussians.sh.shape[1], 0)
    return gaussians.replace(sh=jnp.pad(gaussians.sh, ((0, 0), (0, missing), (0, 0)))[:, :count])


def make_optimizer(config: RefineConfig) -> optax.GradientTransformation:
    """Adam with the paper's rates by parameter; the means' rate is for a scene of extent 1 and decays."""
    chosen = config.rates
    decay = chosen.means_end ** (1 / max(config.steps, 1))
    rates = {
        "means": optax.exponential_decay(chosen.means, 1, decay),
        "log_scales": chosen.scales,
        "quats": chosen.quats,
        "opacity_logits": chosen.opacities,
        "sh": chosen.sh,
        "sh_rest": chosen.sh_rest,
    }
    # eps 1e-15 as in 3DGS: a Gaussian seen by few pixels has gradients far below Adam's default 1e-8.
    transforms = {name: optax.adam(rate, eps=1e-15) for name, rate in rates.items()}
    return optax.multi_transform(transforms, {name: name for name in rates})
