"""RGB-distance panoramas of a room: exact intersections, direct light with shadows, an ambient term, filtered
textures."""

import jax
import jax.numpy as jnp
from jax import lax

from rein3d_jax.geometry.colour import srgb_from_linear
from rein3d_jax.geometry.sphere import pixel_rays, world_from_panorama
from rein3d_jax.rooms.model import Room, TracedPanorama
from rein3d_jax.rooms.tracing.nearest import SHELL_FACES
from rein3d_jax.rooms.tracing.outside import outside
from rein3d_jax.rooms.tracing.pattern import joints, reflectance
from rein3d_jax.rooms.tracing.shade import gather_texture, irradiance, pixel_footprint
from rein3d_jax.rooms.tracing.surface import (
    SurfaceHits,
    SurfaceTable,
    meet_surfaces,
    surface_coordinates,
    surface_table,
)
from rein3d_jax.rooms.tracing.vectors import Vector, choose, components, rotate_left, rotate_right, scale

_FRAME = 0.06  # metres: the bars between panes and panels
_BAR_SHADE = 0.75  # of a door's panels against its bars


def trace(room: Room, world_from_camera: jax.Array, height: int, *, samples: int = 1) -> TracedPanorama:
    """Equirectangular panoramas of height x 2 height pixels from poses (..., 4, 4), all inside the room's free space.

    `samples` x `samples` rays a pixel, averaged as displayed, smooth the silhouettes; textures are smooth already.
    Distance, normal and object id are those of the ray through the pixel's centre, whatever `samples` is; the distance
    is 0 on the windows of a room whose windows are open. Pure; works under jit (height and samples static) and vmap, on
    any platform. Every pose costs the same.
    """
    assert world_from_camera.shape[-2:] == (4, 4), world_from_camera.shape
    assert samples >= 1, samples
    leading = world_from_camera.shape[:-2]
    table = surface_table(room)
    # Frame by frame: its arrays stay in the cache. Channels leave the loop apart and are stacked outside: XLA would
    # compute all that they share once for each (114 ms a panorama, not 45).
    colours, distance, normal, objects = lax.map(
        lambda pose: _frame(room, table, pose, height, samples), world_from_camera.reshape(-1, 4, 4)
    )
    view = TracedPanorama(jnp.stack(colours, axis=-1), distance, jnp.stack(normal, axis=-1), objects)
    return jax.tree.map(lambda x: x.reshape(*leading, *x.shape[1:]), view)


def _frame(room: Room, table: SurfaceTable, pose: jax.Array, height: int, samples: int):
    """(rgb as a vector, distance, normal as a vector, object id), each (h, 2 h)."""
    origin, ray = _rays(room, pose, height)
    hits = meet_surfaces(room, table, origin, ray)
    normal = rotate_left(hits.normal, (jnp.cos(room.yaw), jnp.sin(room.yaw)))
    if samples == 1:
        colour = _colour(room, table, hits, ray, pose, height)
    else:
        colour = _oversampled(room, table, pose, height, samples)
    seen_through = room.open_windows & _is_window(room, hits) & _on_leaf(room, hits)
    return colour, jnp.where(seen_through, 0.0, hits.distance), normal, table.object[hits.index].astype(jnp.int32)


def _oversampled(room: Room, table: SurfaceTable, pose: jax.Array, height: int, samples: int) -> Vector:
    fine = height * samples
    origin, ray = _rays(room, pose, fine)
    hits = meet_surfaces(room, table, origin, ray)
    colour = _colour(room, table, hits, ray, pose, fine)
    return tuple(x.reshape(height, samples, 2 * height, samples).mean((1, 3)) for x in colour)


def _rays(room: Room, pose: jax.Array, height: int) -> tuple[Vector, Vector]:
    """Origin and unit rays (h, 2 h), in the room's axes."""
    position = jnp.matmul(pose[:3, 3], _room_from_world(room).T, precision="highest")
    return components(position), _in_room(room, pose, components(pixel_rays(height, 2 * height)))


def _steps(room: Room, pose: jax.Array, height: int) -> tuple[Vector, Vector]:
    """How the rays change (h, 2 h) from one pixel to the next, to the right and down, in the room's axes."""
    x, y, z = components(pixel_rays(height, 2 * height))
    pitch = jnp.pi / height
    flat = jnp.hypot(x, y)
    right, down = (
        (pitch * y, -pitch * x, jnp.zeros_like(z)),
        (pitch * x * z / flat, pitch * y * z / flat, -pitch * flat),
    )
    return _in_room(room, pose, right), _in_room(room, pose, down)


def _in_room(room: Room, pose: jax.Array, camera: Vector) -> Vector:
    """Vectors (h, w) in the room's axes, of vectors in a panorama's own, whose +X is its centre column."""
    rotation = jnp.matmul(_room_from_world(room), world_from_panorama(pose), precision="highest")
    rows = [[rotation[i, j] for j in range(3)] for i in range(3)]
    return tuple(x * camera[0] + y * camera[1] + z * camera[2] for x, y, z in rows)


def _room_from_world(room: Room) -> jax.Array:
    c, s, nothing = jnp.cos(room.yaw), jnp.sin(room.yaw), jnp.zeros_like(room.yaw)
    rows = [[c, s, nothing], [-s, c, nothing], [nothing, nothing, nothing + 1]]
    return jnp.stack([jnp.stack(row) for row in rows])


def _colour(room: Room, table: SurfaceTable, hits: SurfaceHits, ray: Vector, pose: jax.Array, height: int) -> Vector:
    """Display values (h, w)."""
    steps = _steps(room, pose, height)
    moves = [rotate_right(pixel_footprint(ray, step, hits.distance, hits.normal), hits.heading) for step in steps]
    (du, dv), (eu, ev) = (surface_coordinates(hits.face, move) for move in moves)
    du, dv = jnp.sqrt(du * du + eu * eu), jnp.sqrt(dv * dv + ev * ev)
    u, v = surface_coordinates(hits.face, hits.local)
    texture = gather_texture(room.textures, table.texture[hits.index])
    seed = room.seed + hits.index.astype(jnp.uint32) * jnp.uint32(7919)
    albedo = reflectance(texture, u, v, du, dv, seed)
    pane, bars = _pane(room, hits, du, dv)
    albedo = scale(albedo, 1 - (1 - _BAR_SHADE) * pane * (1 - bars))  # a door's panels; behind glass it is not seen
    light = irradiance(room, hits)
    glow = texture["glow"] / room.exposure
    seen = tuple(a * e + a * glow for a, e in zip(albedo, light, strict=True))
    sky = scale(outside(room.outside, ray, jnp.pi / height, room.seed), 1 / room.exposure)
    seen = choose(_is_window(room, hits) & (pane > 0), _blend(sky, seen, bars), seen)
    return _display(seen, room.exposure, room.gamma)


def _display(light: Vector, exposure: jax.Array, gamma: jax.Array) -> Vector:
    """sRGB in [0, 1] of linear light: 1 - exp(-exposure light), which never clips, raised to `gamma` (contrast)."""
    return tuple(srgb_from_linear((1 - jnp.exp(-exposure * jnp.maximum(x, 0))) ** gamma) for x in light)


def _opening_index(room: Room, hits: SurfaceHits) -> jax.Array:
    return jnp.clip(hits.index - SHELL_FACES, 0, room.openings.wall.shape[0] - 1)


def _on_leaf(room: Room, hits: SurfaceHits) -> jax.Array:
    """On the window or door at the end of a recess, not on the recess's sides."""
    in_recess = (hits.index >= SHELL_FACES) & (hits.index < SHELL_FACES + room.openings.wall.shape[0])
    return in_recess & (hits.face == room.openings.wall[_opening_index(room, hits)] % 2)


def _is_window(room: Room, hits: SurfaceHits) -> jax.Array:
    return room.openings.window[_opening_index(room, hits)] > 0.5


def _pane(room: Room, hits: SurfaceHits, du, dv) -> tuple[jax.Array, jax.Array]:
    """(1 on the leaf at the end of a recess, else 0; share of it that is frame and bars)."""
    opening, pane = _opening_index(room, hits), _on_leaf(room, hits)
    wide = jnp.where(hits.face == 0, hits.half[1], hits.half[0])
    u, v = surface_coordinates(hits.face, hits.local)
    columns, rows = room.openings.panes[opening, 0], room.openings.panes[opening, 1]
    across = joints(u + wide, 2 * wide / columns, jnp.float32(_FRAME), du)
    upwards = joints(v + hits.half[2], 2 * hits.half[2] / rows, jnp.float32(_FRAME), dv)
    return pane.astype(jnp.float32), 1 - (1 - across) * (1 - upwards)


def _blend(a: Vector, b: Vector, share: jax.Array) -> Vector:
    return tuple(x + (y - x) * share for x, y in zip(a, b, strict=True))
