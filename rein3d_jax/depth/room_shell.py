"""A distance for a photograph that has none: the box it was taken in, fitted to its own edges and colours.

Scale comes from the camera's height alone: a camera k times as high sees the same picture in a room k times as
large. What stands in the room is not modelled, so this is a room-shell distance, and whoever shows it says so.

The fit maximises the mean edge support (picture_edges) along the box's twelve projected lines, which has many
maxima: boxes climb from random starts, each on its own. A box whose size alone changes keeps its corners and
ceiling lines, and its floor lines, hidden by furniture, are weak evidence: so the size is chosen by how well
walls, ceiling and floor part the picture's colours (picture_parts) as well, and jaxopt refines on all of it.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp

from rein3d_jax.conventions import EYE_HEIGHT
from rein3d_jax.depth.shell_evidence import (
    Evidence,
    coarse_support,
    colour_information,
    fine_support,
    picture_evidence,
    shell_of,
)
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import pixel_rays
from rein3d_jax.settings import Settings, setting

_STEPS = 0.7, 0.02  # log metres; how far the first and the last round of climbing reach
_YAW_STEP = 0.35  # radians for one log metre
_CHANGED = 0.4  # share of a child's parts that differ from its parent's
_SIZES = 41  # tried for each box, from 1/e to e times its own


@dataclass(frozen=True)
class RoomShellConfig(Settings):
    """The room fit's settings. Ranges only lean on the fit: rooms may be larger or smaller."""

    wall_range: tuple[float, float] = setting((0.6, 5.0), "walls' distances", within="(0, inf)", unit="camera heights")
    ceiling_range: tuple[float, float] = setting(
        (0.375, 1.6), "ceiling's height above the camera", within="(0, inf)", unit="camera heights"
    )
    max_aspect: float = setting(2.0, "room's length over its width", within="[1, inf)")
    prior: float = setting(0.3, "loss of one squared log unit outside the ranges", within="[0, inf)")
    # Nothing stands before a ceiling line; furniture hides floor lines, and doors, windows and cupboards have vertical
    # lines of their own.
    edge_weights: tuple[float, float, float] = setting((0.5, 1.0, 0.5), "of floor, ceiling, corner", within="[0, inf)")
    colour_weight: float = setting(0.7, "weight of a nat of information against edge support", within="[0, inf)")
    noise: float = setting(0.005, "sRGB step per pixel that is half an edge", within="(0, inf)")
    texture: float = setting(1.0, "times its surroundings' mean energy that an edge must have", within="[0, inf)")
    climbers: int = setting(512, "boxes that climb from random starts", within="[1, inf)")
    rounds: int = setting(16, "rounds of climbing", within="[1, inf)")
    children: int = setting(11, "tries of each box in a round", within="[1, inf)")
    finalists: int = setting(8, "boxes that are refined in the end", within="[1, inf)")
    seed: int = setting(0, "seed of the random starts", within="[0, 4294967295]")

    def __post_init__(self):
        super().__post_init__()
        for name in ("wall_range", "ceiling_range"):
            low, high = getattr(self, name)
            if low >= high:
                raise InputError(f"{name} must be two numbers, the smaller first, not {low}, {high}")
        if not any(self.edge_weights):
            raise InputError("edge_weights must not all be 0")


def fit_room_shell(
    rgb: jax.Array, camera_height: float = EYE_HEIGHT, *, config: RoomShellConfig
) -> tuple[RoomShell, dict[str, float]]:
    """The box around the camera of an upright panorama (h, 2h, 3) in sRGB, taken `camera_height` metres above the
    floor, and how well the picture bears it out: `support`, in [0, 1], the mean edge support along its lines (0.35 to
    0.55 in furnished rooms), and `loss`. The fit is made in camera heights: another height only multiplies it.

    Deterministic for a seed. Raises InputError for a picture without edges."""
    height, width, channels = rgb.shape
    assert width == 2 * height and channels == 3, rgb.shape
    evidence = picture_evidence(rgb, noise=config.noise, texture=config.texture)
    if float(jnp.max(evidence.sharp)) < 0.01:  # noise of half a grey level gives more
        raise InputError("the picture shows no edges to fit a room to; give its distance map")
    ends = [_refine(box, evidence, config) for box in _search(evidence, config=config)]
    box, loss, support = min(ends, key=lambda end: end[1])
    return shell_of(box, camera_height), {"support": support, "loss": loss}


def shell_distance(shell: RoomShell, height: int, width: int) -> jax.Array:
    """The distance (height, width) in metres along each pixel's ray to the inside of the box, exact."""
    return meet_shell(shell, jnp.zeros(3), pixel_rays(height, width))[0]


def _outside(x: jax.Array, low: jax.Array, high: jax.Array) -> jax.Array:
    return jnp.sum(jnp.maximum(jnp.maximum(low - x, x - high), 0.0) ** 2)


def _unlikely(box: jax.Array, config: RoomShellConfig) -> jax.Array:
    """Squared log units by which a box is outside of what rooms are."""
    aspect = jnp.logaddexp(box[1], box[3]) - jnp.logaddexp(box[2], box[4])
    limit = jnp.log(config.max_aspect)
    walls = _outside(box[1:5], *jnp.log(jnp.array(config.wall_range)))
    return walls + _outside(box[5], *jnp.log(jnp.array(config.ceiling_range))) + _outside(aspect, -limit, limit)


def _edge_loss(box: jax.Array, evidence: Evidence, config: RoomShellConfig) -> jax.Array:
    """What ranks boxes during the climb."""
    return 1 - coarse_support(box, evidence, config.edge_weights) + config.prior * _unlikely(box, config)


def _loss(box: jax.Array, evidence: Evidence, config: RoomShellConfig) -> tuple[jax.Array, jax.Array]:
    """What is minimised in the end, and the edge support in it."""
    support = fine_support(box, evidence, config.edge_weights)
    informed = config.colour_weight * colour_information(box, evidence)
    return 1 - support - informed + config.prior * _unlikely(box, config), support


def _random_boxes(key: jax.Array, config: RoomShellConfig) -> jax.Array:
    """Boxes (climbers, 6), uniform in yaw and in the logs of the ranges."""
    low = jnp.array([-jnp.pi / 4, *jnp.log(jnp.array([config.wall_range[0]] * 4 + [config.ceiling_range[0]]))])
    high = jnp.array([jnp.pi / 4, *jnp.log(jnp.array([config.wall_range[1]] * 4 + [config.ceiling_range[1]]))])
    return jax.random.uniform(key, (config.climbers, 6), minval=low, maxval=high)


def climb(boxes: jax.Array, key: jax.Array, step: jax.Array, loss: Callable, children: int):
    """Boxes (n, 6), each the best of itself and of its children by `loss` of a box, and their losses (n,). A child
    differs in some of its parts, so that one wrong wall can be mended alone; its lengths tend to change together."""
    parts, whole, chosen = jax.random.split(key, 3)
    noise = jax.random.normal(parts, (children, *boxes.shape)).at[..., 0].multiply(_YAW_STEP)
    noise = noise.at[..., 1:].add(jax.random.normal(whole, (children, len(boxes), 1)))
    noise *= jax.random.bernoulli(chosen, _CHANGED, noise.shape)
    family = jnp.concatenate([boxes[None], boxes + step * noise])
    # In batches that stay within a few MB.
    losses = jax.lax.map(loss, family.reshape(-1, 6), batch_size=512).reshape(-1, len(boxes))
    return family[jnp.argmin(losses, axis=0), jnp.arange(len(boxes))], jnp.min(losses, axis=0)


def _best_size(box: jax.Array, evidence: Evidence, config: RoomShellConfig) -> jax.Array:
    sizes = box + jnp.linspace(-1, 1, _SIZES)[:, None] * jnp.array([0.0, 1, 1, 1, 1, 1])
    return sizes[jnp.argmin(jax.vmap(lambda box: _loss(box, evidence, config)[0])(sizes))]


@partial(jax.jit, static_argnames=("config",))
def _search(evidence: Evidence, config: RoomShellConfig) -> jax.Array:
    """The finalists (finalists, 6): the best of many boxes that climbed from random starts, each in its best size."""
    key, start = jax.random.split(jax.random.key(config.seed))
    steps = _STEPS[0] * (_STEPS[1] / _STEPS[0]) ** jnp.linspace(0, 1, config.rounds)
    rounds = (jax.random.split(key, config.rounds), steps)
    boxes, loss = _random_boxes(start, config), partial(_edge_loss, evidence=evidence, config=config)
    boxes, losses = jax.lax.scan(lambda boxes, x: climb(boxes, *x, loss, config.children), boxes, rounds)
    boxes = boxes[jnp.argsort(losses[-1])[: config.finalists]]
    return jax.lax.map(lambda box: _best_size(box, evidence, config), boxes)


_loss_and_slope = jax.jit(jax.value_and_grad(_loss, has_aux=True), static_argnames=("config",))


def _refine(box: jax.Array, evidence: Evidence, config: RoomShellConfig) -> tuple[jax.Array, float, float]:
    """The nearest local optimum, its loss and support, by L-BFGS-B: SciPy's through jaxopt, since jaxopt's own
    LBFGS takes 15 CPU seconds to compile here and this one 4."""
    import jaxopt  # not before: SciPy's optimizers take 0.4 s to import, and most jobs fit no box

    def fun(box):
        (loss, _), slope = _loss_and_slope(box, evidence, config)
        return loss, slope

    # jit=False: `fun` is jitted already, and jaxopt would compile it anew for every solver.
    solver = jaxopt.ScipyMinimize(fun=fun, value_and_grad=True, method="L-BFGS-B", tol=1e-6, jit=False)
    box = solver.run(box).params
    (loss, support), _ = _loss_and_slope(box, evidence, config)
    return box, float(loss), float(support)
