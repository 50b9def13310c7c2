"""A box room in closed form: patterned or white; seen from anywhere, lifted, or as views.
For `benchmarks.stability`."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from rein3d_jax.geometry.poses import rigid
from rein3d_jax.geometry.shell import RoomShell, meet_shell
from rein3d_jax.geometry.sphere import rays_of_pose, world_from_camera_axes
from rein3d_jax.lift import LiftConfig, lift, with_capacity
from rein3d_jax.refine import Views, ViewsConfig, join_views, views_from_panorama
from rein3d_jax.scene import Gaussians, Panorama

HEIGHT = 32  # rows of a panorama: 2,048 Gaussians
BOX = RoomShell(*(jnp.asarray(x) for x in (0.2, (2.2, 1.8, 2.4, 1.6), 1.5, 1.2)))
PLACES = [0.7 * np.array([np.cos(a), np.sin(a), 0.3 * np.sin(3 * a)]) for a in np.arange(6) * np.pi / 3]  # fitted to

Paint = Callable[[jax.Array, jax.Array, jax.Array], jax.Array]  # points, faces, rays -> colours


def pattern(points: jax.Array, face: jax.Array, rays: jax.Array) -> jax.Array:
    """Waves of 0.9 to 1.6 m, of another tint on each face."""
    tint = 0.15 * jnp.sin(face[..., None] * jnp.array([1.0, 2.3, 3.7]) + jnp.array([0.0, 1.0, 2.0]))
    waves = jnp.stack([jnp.sin(points @ jnp.array(k)) for k in ((7.0, 1, 2), (1, 6.0, 3), (2, 3, 5.0))], axis=-1)
    return 0.5 + tint + 0.25 * waves


def white(points: jax.Array, face: jax.Array, rays: jax.Array) -> jax.Array:
    """One flat colour."""
    return jnp.full_like(points, 0.9)


def pose_at(place) -> jax.Array:
    """world_from_camera of an upright panorama at yaw 0."""
    return rigid(world_from_camera_axes(), jnp.asarray(place, jnp.float32))


def true_panorama(place, paint: Paint) -> tuple[jax.Array, jax.Array, jax.Array]:
    """True (rgb, distance, face) of the box from `place`."""
    rays = rays_of_pose(pose_at(place), HEIGHT, 2 * HEIGHT)
    distance, face = meet_shell(BOX, jnp.asarray(place, jnp.float32), rays)
    return paint(jnp.asarray(place) + distance[..., None] * rays, face, rays), distance, face


def lifted(paint: Paint, *, spare: float = 1.0, noise: float = 0.0) -> Gaussians:
    """The box as it is from the origin, distances off by a share of `noise`, and a share of `spare` slots."""
    rgb, distance, _ = true_panorama(np.zeros(3), paint)
    distance *= jnp.exp(noise * jax.random.normal(jax.random.key(0), distance.shape))
    everywhere = jnp.ones(distance.shape, bool)
    scene = lift(Panorama(rgb, distance, everywhere), pose_at(np.zeros(3)), everywhere, config=LiftConfig())
    return with_capacity(scene, int(scene.alive.size * (1 + spare)))


def views_of(paint: Paint, config: ViewsConfig, *, tint=lambda source: 0.0, weight=lambda source: 1.0) -> Views:
    """Of the box from the origin (source 0) and from PLACES (sources 1 and 2 alternately)."""
    parts = []
    for index, place in enumerate([np.zeros(3), *PLACES]):
        source = 0 if index == 0 else 1 + index % 2
        rgb, distance, _ = true_panorama(place, paint)
        frame = (rgb + tint(source), weight(source) * jnp.ones_like(distance), pose_at(place))
        parts.append(views_from_panorama(*frame, yaw=0.3 * index, config=config))
    return join_views(*parts)
