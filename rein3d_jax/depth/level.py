"""How far a panorama leans, read off its edges, and the panorama levelled.

A straight line in the room is a great circle in the panorama, whose normal is the edge's gradient direction; all lines
along one direction of the room have normals square to it. Rooms have three such directions, square to each other, and
the one near the picture's own up is the room's. So `estimate_lean` looks for the rotation near upright whose three
axes have the most edges running along them: over a map of the support of each direction first, then in ever smaller
steps. Uprights alone would be few in a room whose walls are bare; ceilings, tables and shelves tell as much.

What is not plain is left alone: a picture that stands nearly level loses more by being resampled.
"""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from flax import struct

from rein3d_jax.depth.picture_edges import blur, edge_tensors, sharp_gradients
from rein3d_jax.geometry.resample import sample_sphere, sample_sphere_cubic
from rein3d_jax.geometry.rotations import matrix_from_quats
from rein3d_jax.geometry.safe import safe_norm
from rein3d_jax.geometry.sphere import pixel_rays, pixel_solid_angles, pixels_from_rays
from rein3d_jax.scene import Panorama

_ROWS = 256  # of the picture whose edges are read; the noise and blur scales are tied to it
_NOISE, _TEXTURE = 0.005, 1.0  # edge_tensors', as the room fit has them
_EDGES = 8192  # strongest pixels that are read: a sixteenth of the sphere
_WIDTH = 0.035  # radians between an edge and a direction at which its support is exp(-1/2)
_MAP_ROWS = 90  # of the map of directions: 2 degrees, the width of a peak
_FARTHEST, _UP_STEP, _YAWS = 24.0, 2.0, 45  # degrees of lean and between tries; tries in a quarter of a circle
_STARTS = 6  # rotations that are refined
_STEPS = 1.2 * 0.7 ** np.arange(10)  # degrees; the last is 0.05
_APART = 6.0  # degrees beyond which another up is a rival, and no longer the same peak
_LEVEL = 1.5  # degrees; below it a picture is left alone: upright ones are read off by up to 1.4
_FEW = 0.01  # share of the sphere: an up that fewer edges support is not believed however alone it stands
_PLAIN = 0.045  # confidence below which the lean is not believed: noise has up to 0.034, rooms have 0.064 and more
_TOLD, _SLIGHT = 2.0, 0.05  # confidence of a lean that the file tells, and degrees of one that is none
LEANED, STOOD_LEVEL, NOT_TOLD, NOT_ASKED = "leaned", "level", "unknown", "not asked"


@struct.dataclass
class Lean:
    """Where a picture's room has its up, and how plain that is."""

    up: jax.Array  # (3,) unit, in the picture's axes: those of `pixel_rays`, as if it stood level
    confidence: jax.Array  # () share of its support by which the best up beats the next, in [0, 1]; -1: nobody asked;
    # _TOLD: the file tells it

    @property
    def degrees(self) -> float:
        """The angle between the picture's up and the room's."""
        return float(np.degrees(np.arctan2(np.hypot(self.up[0], self.up[1]), self.up[2])))

    @property
    def roll(self) -> float:
        """Degrees by which the camera leaned to its right, about its forward axis."""
        return float(np.degrees(np.arctan2(self.up[1], self.up[2])))

    @property
    def pitch(self) -> float:
        """Degrees by which the camera's forward axis pointed above the horizon."""
        return float(np.degrees(np.arctan2(self.up[0], np.hypot(self.up[1], self.up[2]))))

    @property
    def verdict(self) -> str:
        """LEANED, STOOD_LEVEL (within _LEVEL degrees), NOT_TOLD or NOT_ASKED."""
        if float(self.confidence) < 0:
            return NOT_ASKED
        if not float(self.confidence) > _PLAIN:
            return NOT_TOLD
        return LEANED if self.degrees > (_SLIGHT if self.told else _LEVEL) else STOOD_LEVEL

    @property
    def told(self) -> bool:
        """Whether the file tells it."""
        return float(self.confidence) >= _TOLD

    @property
    def level_from_picture(self) -> jax.Array:
        """The rotation (3, 3) that `levelled` applies to directions: the least one that brings `up` to +Z, so that the
        heading stays; the identity where the picture is left alone."""
        if self.verdict != LEANED:
            return jax.device_put(np.eye(3, dtype=np.float32))
        x, y, z = self.up  # quaternion (1 + cos, up x Z) of twice its half angle
        return matrix_from_quats(jnp.stack([1 + z, y, -x, jnp.zeros_like(x)]))

    @property
    def sentence(self) -> str:
        """What was found and done, for a person."""
        parts = f"roll {self.roll:+.1f}, pitch {self.pitch:+.1f}"
        source = ", as its file tells," if self.told else ""
        return {
            LEANED: f"The photograph leaned by {self.degrees:.1f} degrees ({parts}){source} and was levelled.",
            STOOD_LEVEL: f"The photograph stood level, within {_LEVEL} degrees, and was left as it is.",
            NOT_TOLD: "Whether the photograph leans could not be told from its edges: it was left as it is.",
            NOT_ASKED: "The photograph was taken to stand level, as was asked.",
        }[self.verdict]


def unasked_lean() -> Lean:
    """The lean of a picture that is taken to stand level."""
    return Lean(jnp.array([0.0, 0.0, 1.0]), jnp.array(-1.0))


def lean_of(roll: float, pitch: float) -> Lean:
    """The lean that a file tells: degrees by which the camera leaned to its right, and pointed above the horizon."""
    roll, pitch = np.radians([roll, pitch])
    up = [np.sin(pitch), np.cos(pitch) * np.sin(roll), np.cos(pitch) * np.cos(roll)]
    return Lean(jnp.array(up, jnp.float32), jnp.array(_TOLD))


def levelled(panorama: Panorama, lean: Lean) -> Panorama:
    """The panorama as a camera that did not lean would have taken it; the very same where `lean.verdict` is not
    LEANED."""
    return level_panorama(panorama, lean.level_from_picture) if lean.verdict == LEANED else panorama


@jax.jit
def level_panorama(panorama: Panorama, rotation: jax.Array) -> Panorama:
    """The panorama (h, 2 h) rotated: what it shows along r is shown along `rotation` (3, 3) r. Colours are interpolated
    by cubics; distances, which a rotation about the camera leaves as they are, are the nearest pixel's, since between
    two surfaces there is nothing, and so is `valid`."""
    height, width = panorama.distance.shape

    def row(rays):
        u, v = pixels_from_rays(jnp.matmul(rays, rotation, precision="highest"), height, width)
        at = jnp.clip(jnp.floor(v).astype(jnp.int32), 0, height - 1), jnp.floor(u).astype(jnp.int32) % width
        rgb = jnp.clip(sample_sphere_cubic(panorama.rgb, u, v), 0.0, 1.0)
        return Panorama(rgb, panorama.distance[at], panorama.valid[at])

    return jax.lax.map(row, pixel_rays(height, width))  # by rows, or large pictures take gigabytes


@struct.dataclass
class _Edges:
    """The strongest edges of a picture."""

    rays: jax.Array  # (n, 3) where they are
    normals: jax.Array  # (n, 3) of the great circles that they run along
    weights: jax.Array  # (n,) strength in [0, 1] times share of the sphere


@jax.jit
def estimate_lean(rgb: jax.Array) -> Lean:
    """The lean of a panorama (h, 2h, 3), sRGB in [0, 1], of at most _FARTHEST degrees. Deterministic."""
    assert rgb.ndim == 3 and rgb.shape[1:] == (2 * rgb.shape[0], 3), rgb.shape
    edges = _edges(jax.image.resize(rgb, (_ROWS, 2 * _ROWS, 3), "linear"))
    ups, sides, scores = _search(edges)
    chosen = jax.lax.top_k(scores.reshape(-1), _STARTS)[1]
    up, side = ups[chosen // _YAWS], sides.reshape(-1, 3)[chosen]
    up = _refine(jnp.stack([side, jnp.cross(up, side), up], axis=-2), edges)
    best = jnp.max(scores, axis=1)  # of each up
    rival = jnp.max(best, where=ups @ up < np.cos(np.radians(_APART)), initial=0.0)
    confidence = (jnp.max(best) - rival) / (jnp.max(best) + _FEW)
    return Lean(up, jnp.clip(confidence, 0.0, 1.0))


def _edges(rgb: jax.Array) -> _Edges:
    tensors = blur(edge_tensors(rgb, noise=_NOISE, texture=_TEXTURE, gradients=sharp_gradients), 1.0)
    ee, en, nn = jnp.moveaxis(tensors, -1, 0)
    share = pixel_solid_angles(*ee.shape) / (4 * jnp.pi)
    weights, chosen = jax.lax.top_k((jnp.hypot(ee - nn, 2 * en) * share).reshape(-1), _EDGES)
    rays = pixel_rays(*ee.shape).reshape(-1, 3)[chosen]
    angle = (jnp.arctan2(2 * en, ee - nn) / 2).reshape(-1, 1)[chosen]  # of the gradient, from east to north
    x, y, _ = rays.T
    east = jnp.stack([y, -x, jnp.zeros_like(x)], axis=-1) / jnp.hypot(x, y)[:, None]
    return _Edges(rays, jnp.cos(angle) * east + jnp.sin(angle) * jnp.cross(east, rays), weights)


def _support(directions: jax.Array, edges: _Edges) -> jax.Array:
    """The weight (k,) of the edges that run along `directions` (k, 3): whose angle to the direction, as it is seen at
    the edge's own place, is small."""
    exact = partial(jnp.matmul, precision="highest")
    square = exact(directions, edges.normals.T) ** 2  # sin^2(angle) times that of the way to the direction
    away = 1 - exact(directions, edges.rays.T) ** 2
    return exact(jnp.exp(-square / (2 * _WIDTH**2 * jnp.maximum(away, 1e-3))), edges.weights)


def _support_map(edges: _Edges) -> jax.Array:
    """The support (_MAP_ROWS, 2 _MAP_ROWS) of every direction; opposite ones have the same."""
    upper = pixel_rays(_MAP_ROWS, 2 * _MAP_ROWS)[: _MAP_ROWS // 2]
    upper = jax.lax.map(lambda row: _support(row, edges), upper)  # a row's products stay in the cache
    return jnp.concatenate([upper, jnp.roll(upper[::-1], _MAP_ROWS, axis=1)])


def _search(edges: _Edges) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Ups (n, 3) near the picture's own, sides (n, _YAWS, 3) square to each, and the support (n, _YAWS) of the three
    axes together."""
    reach = np.arange(-_FARTHEST, _FARTHEST + 1, _UP_STEP)
    tilts = np.stack(np.meshgrid(reach, reach), axis=-1).reshape(-1, 2)
    tilts = jnp.asarray(np.radians(tilts[np.hypot(*tilts.T) <= _FARTHEST]), jnp.float32)
    ups = matrix_from_quats(_quats(jnp.pad(tilts, ((0, 0), (0, 1)))))[..., 2]
    first = jnp.cross(jnp.array([0.0, 1.0, 0.0]), ups)
    first = (first / safe_norm(first, keepdims=True))[:, None]
    second = jnp.cross(ups[:, None], first)
    yaws = jnp.arange(_YAWS)[:, None] / _YAWS * jnp.pi / 2
    sides = jnp.cos(yaws) * first + jnp.sin(yaws) * second
    others = jnp.cos(yaws) * second - jnp.sin(yaws) * first
    seen = _support_map(edges)
    up, side, other = (sample_sphere(seen, *pixels_from_rays(x, *seen.shape)) for x in (ups, sides, others))
    return ups, sides, up[:, None] + side + other


def _refine(axes: jax.Array, edges: _Edges) -> jax.Array:
    """The up (3,) of the best of some rotations, rows of (k, 3, 3), after each took the best of 27 steps many times."""
    offsets = jnp.stack(jnp.meshgrid(*[jnp.arange(-1.0, 2.0)] * 3), axis=-1).reshape(-1, 3)

    def climb(axes, step):
        steps = matrix_from_quats(_quats(step * offsets))
        family = jnp.einsum("kij,nlj->knil", axes, steps, precision="highest")
        support = _support(family.reshape(-1, 3), edges).reshape(*family.shape[:2], 3).sum(axis=-1)
        return family[jnp.arange(len(axes)), jnp.argmax(support, axis=1)], jnp.max(support, axis=1)

    axes, support = jax.lax.scan(climb, axes, jnp.radians(jnp.asarray(_STEPS, jnp.float32)))
    return axes[jnp.argmax(support[-1]), 2]


def _quats(vectors: jax.Array) -> jax.Array:
    """Quaternions (..., 4) of small rotations about (..., 3) by its length, radians: half angles as their tangents."""
    return jnp.concatenate([jnp.ones_like(vectors[..., :1]), vectors / 2], axis=-1)
