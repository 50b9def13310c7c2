"""The collider of a drawn room is closed, stays out of what is free and inside the room's shell; who keeps to its
navigation mesh runs into nothing, and gets wherever there is room."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import trimesh

from rein3d_jax.depth.shell_from_distance import shell_from_distance
from rein3d_jax.errors import InputError
from rein3d_jax.geometry.poses import upright
from rein3d_jax.geometry.shell import RoomShell, meet_shell, world_from_shell
from rein3d_jax.geometry.sphere import rays_of_pose64
from rein3d_jax.meshes.collider import MAX_COLLIDER_TRIANGLES, Collider, room_collider
from rein3d_jax.meshes.convex_parts import convex_parts
from rein3d_jax.meshes.free_space import FLATTENED, shell_corners
from rein3d_jax.meshes.navigation import AgentConfig, walkable_floor
from rein3d_jax.meshes.ray_caster import RayCaster
from rein3d_jax.meshes.solid import box_solid, mesh_of_solid
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room
from rein3d_jax.rooms.tracing.trace import trace
from rein3d_jax.scene import Panorama

ROWS, VOXEL = 96, 0.08
OUTSIDE = 30.0  # metres: what a window shows
DOWN = np.array([0.0, 0.0, -1.0])
AGENT = AgentConfig(0.25, 1.6)


@pytest.fixture(scope="module")
def seen():
    """Distances (n, h, w) of a drawn room with open windows and the poses (n, 4, 4) they were seen from: the origin,
    and as far as 0.4 m before what stands in eight directions."""
    room = jax.jit(lambda key: generate_room(key, RoomConfig(open_windows=1.0)))(jax.random.key(2))
    see = jax.jit(lambda pose: trace(room, pose, ROWS).distance)
    poses = [np.asarray(upright(np.zeros(3)))]
    first = np.asarray(see(poses[0]))
    for column in range(ROWS // 8, 2 * ROWS, ROWS // 4):
        around = first[ROWS * 3 // 8 : ROWS * 5 // 8, column - ROWS // 8 : column + ROWS // 8]
        ray = rays_of_pose64(poses[0], ROWS)[ROWS // 2, column] * [1, 1, 0]
        poses.append(np.asarray(upright(max(around[around > 0].min() - 0.4, 0) * ray)))
    distance = np.stack([first, *(np.asarray(see(pose)) for pose in poses[1:])])
    return np.where(distance > 0, distance, OUTSIDE), np.stack(poses)


@pytest.fixture(scope="module")
def shell(seen):
    first = jnp.asarray(seen[0][0])
    known = first < OUTSIDE
    return shell_from_distance(Panorama(jnp.zeros((*first.shape, 3)), first, known))[0]


@pytest.fixture(scope="module")
def collider(seen, shell):
    return room_collider(shell, zip(*map(jnp.asarray, seen), strict=True), voxel=VOXEL)


@pytest.fixture(scope="module")
def caster(collider):
    return RayCaster(collider.vertices[collider.faces])


def test_every_edge_has_two_faces_that_face_the_room(collider, caster):
    mesh = trimesh.Trimesh(collider.vertices, collider.faces, process=False)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume < 0
    assert 500 < len(collider.faces) <= MAX_COLLIDER_TRIANGLES
    rays = rays_of_pose64(np.eye(4), 16).reshape(-1, 3)
    hits = caster.cast(np.zeros(3), rays)
    assert (hits.triangle >= 0).all() and ((caster.normal[hits.triangle] * rays).sum(1) < 0).all()


def test_ends_at_the_shell_windows_included(collider, shell):
    inside = collider.vertices @ np.asarray(world_from_shell(shell), np.float64)
    bounds = np.array([inside.min(axis=0), inside.max(axis=0)])
    np.testing.assert_allclose(bounds, shell_corners(shell), atol=1e-6)  # float64, and the shell's rotation in float32


def test_what_was_seen_through_is_free_and_what_was_seen_is_there(seen, shell, caster):
    off = []
    for distance, pose in zip(*seen, strict=True):
        rays, eye = rays_of_pose64(pose, ROWS).reshape(-1, 3), np.float64(pose[:3, 3])
        within = np.minimum(distance.ravel(), meet_shell(shell, jnp.float32(eye), jnp.float32(rays))[0])
        off.append(caster.cast(eye, rays).distance - within)
    off = np.concatenate(off)
    print(f"off by {np.median(np.abs(off)):.4f} m; {np.mean(off < -VOXEL):.4f} short, {np.mean(off > 0.2):.4f} beyond")
    # Outlines seen by pixels of 1.9 degrees; things thinner than a voxel are lost.
    assert np.median(np.abs(off)) < 0.01 and np.mean(off < -VOXEL) < 0.03 and np.mean(off > 0.2) < 0.04


def test_the_floor_is_flat_where_it_was_seen(seen, caster):
    places = np.concatenate(
        [
            pose[:3, 3] + rays_of_pose64(pose, ROWS) * distance[..., None]
            for distance, pose in zip(seen[0], np.float64(seen[1]), strict=True)
        ]
    ).reshape(-1, 3)
    floor = places[np.abs(places[:, 2] + 1.6) < 1e-3]
    hits = caster.cast(floor - 0.05 * DOWN, np.broadcast_to(DOWN, floor.shape))
    flat = np.abs(hits.distance - 0.05) < 1e-4
    print(f"{flat.mean():.4f} of {len(floor)}")
    assert len(floor) > 10_000 and flat.mean() > 0.98  # elsewhere it is the foot of something, a voxel or a pixel wide


@pytest.fixture(scope="module")
def walkable(collider):
    return walkable_floor(collider, AGENT)


def in_the_way(collider):
    """Places (n, 2) on the collider's surface that an agent could run into, 2 cm apart or less."""
    mesh = trimesh.Trimesh(collider.vertices, collider.faces, process=False)
    places = trimesh.sample.sample_surface(mesh, 200_000, seed=0)[0]
    places = places[(places[:, 2] > collider.floor + 0.005) & (places[:, 2] < collider.floor + AGENT.height)]
    return places[:, :2]


def nearest(places, others):
    from scipy.spatial import cKDTree

    return cKDTree(others).query(places)[0]


def test_who_keeps_to_the_navigation_mesh_stands_on_the_floor_and_touches_nothing(collider, caster, walkable):
    corners = walkable.corners[walkable.faces]
    random = np.random.default_rng(0)
    size = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    assert size.sum() == pytest.approx(walkable.area)
    weights = random.dirichlet(np.ones(3), 5000)
    places = (corners[random.choice(len(size), 5000, p=size / size.sum())] * weights[..., None]).sum(axis=1)
    hits = caster.cast(places - AGENT.height * DOWN, np.broadcast_to(DOWN, places.shape))
    np.testing.assert_allclose(hits.distance, AGENT.height, atol=1e-4)  # nothing between, and the floor below
    gap = nearest(np.concatenate([places, walkable.corners])[:, :2], in_the_way(collider))
    assert gap.min() >= AGENT.radius - 1e-6


def test_the_navigation_mesh_covers_where_an_agent_can_get(collider, caster, walkable):
    """Against a grid of standing places, filled from the origin."""
    from scipy.ndimage import label

    step, low = 0.04, np.floor(collider.vertices.min(axis=0)[:2])
    counts = np.ceil((collider.vertices.max(axis=0)[:2] - low) / step).astype(int)
    grid = low + step * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    places = np.concatenate([grid.reshape(-1, 2), np.full((grid[..., 0].size, 1), collider.floor + 0.01)], axis=1)
    within = caster.cast(places, np.broadcast_to(-DOWN, places.shape))  # fronts face the room
    within = (within.triangle >= 0) & (caster.normal[within.triangle][:, 2] < 0)
    free = (within & (nearest(places[:, :2], in_the_way(collider)) >= AGENT.radius)).reshape(counts)
    parts = label(free)[0]
    origin = tuple(np.round(-low / step).astype(int))
    reached = (parts == parts[origin]).sum() * step**2
    print(f"{walkable.area:.2f} of {reached:.2f} square metres")
    assert parts[origin] and 0.95 * reached < walkable.area < 1.02 * reached
    np.testing.assert_array_equal(walkable.start, [0, 0, collider.floor])


def test_what_cannot_be_is_refused(collider, shell):
    with pytest.raises(InputError, match=r"2.0 x 1.6 m can stand nowhere on the floor: give a smaller"):
        walkable_floor(collider, AgentConfig(2.0))
    with pytest.raises(InputError, match=r"voxel 0.001 asks for .* raise it"):
        room_collider(shell, [], voxel=0.001)
    with pytest.raises(InputError, match=r"voxel 1 asks for .* lower it"):
        room_collider(shell, [], voxel=1)
    with pytest.raises(InputError, match="voxel must be more than 0 metres, not nan"):
        room_collider(shell, [], voxel=float("nan"))
    with pytest.raises(InputError, match="is not free"):
        room_collider(shell, [(jnp.zeros((8, 16)), jnp.eye(4))], voxel=0.2)


def test_a_speck_is_no_obstacle_and_what_is_flat_on_a_wall_is_wall():
    """A box of 4 x 4 x 2.6 m, with a thing of 8 cm floating in it and a plate on the wall, thinner than FLATTENED."""
    room = RoomShell(jnp.zeros(()), jnp.full(4, 2.0), jnp.float32(1.5), jnp.float32(1.1))
    things = [box_at([1.0, 0.5, 0.3], 0.04), np.array([[1.95, -1.0, -1.0], [3.0, 1.0, 1.0]])]
    assert 2 - things[1][0, 0] < FLATTENED
    views = []
    for place in ([0.0, 0.0, 0.0], [1.4, -1.2, 0.0], [1.4, 1.4, 0.4], [-1.0, 1.0, 0.0], [1.7, 0.4, 0.9]):
        pose = np.asarray(upright(np.array(place)), np.float64)
        views.append((jnp.float32(box_distance(pose, things)), jnp.float32(pose)))
    found = room_collider(room, views, voxel=VOXEL)
    assert len(found.faces) == 12
    np.testing.assert_allclose(np.abs(found.vertices[:, :2]), 2.0, atol=1e-6)


def test_convex_parts_are_convex_and_fill_what_is_not_free():
    """A room with an L of two boxes in it: six slabs, and few parts as large as the L."""
    room = RoomShell(jnp.float32(0.3), jnp.full(4, 2.0), jnp.float32(1.5), jnp.float32(1.1))
    low, high = shell_corners(room)
    thing = box_solid([0.5, 0.5, -1.5], [1.5, 0.9, -0.5]) + box_solid([0.5, 0.5, -1.5], [0.9, 1.7, -0.5])
    vertices, faces = mesh_of_solid(box_solid(low, high) - thing)
    rotation = np.asarray(world_from_shell(room), np.float64)
    parts = convex_parts(Collider(vertices @ rotation.T, faces[:, ::-1], room))
    assert list(parts)[:6] == ["back", "right", "floor", "front", "left", "ceiling"] and len(parts) < 10
    meshes = [trimesh.Trimesh(vertices @ rotation, faces) for vertices, faces in parts.values()]
    assert all(mesh.is_convex and mesh.is_watertight and mesh.volume > 0 for mesh in meshes)
    assert sum(mesh.volume for mesh in meshes[6:]) == pytest.approx(thing.volume(), rel=0.05)  # by voxels of 3 cm
    slabs = np.array([mesh.bounds for mesh in meshes[:6]])
    np.testing.assert_allclose(slabs[:3, 1].diagonal(), low, atol=1e-6)
    np.testing.assert_allclose(slabs[3:, 0].diagonal(), high, atol=1e-6)


def box_at(middle, half):
    return np.array([np.subtract(middle, half), np.add(middle, half)])


def box_distance(pose, things):
    """Distances (h, w) from `pose` to the walls of that box, or to a thing before them."""
    eye, rays = pose[:3, 3], rays_of_pose64(pose, ROWS)
    walls = np.array([[-2.0, -2.0, -1.5], [2.0, 2.0, 1.1]])
    nearest_hit = ((walls[:, None, None] - eye) / rays).max(axis=0).min(axis=-1)
    for thing in things:
        ends = (thing[:, None, None] - eye) / rays
        enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
        nearest_hit = np.where((enter > 0) & (enter < leave), np.minimum(nearest_hit, enter), nearest_hit)
    return nearest_hit
