"""Distances, ids and normals against independent intersections."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from rein3d_jax.geometry.sphere import rays_of_pose
from rein3d_jax.rooms.config import RoomConfig
from rein3d_jax.rooms.generate import generate_room

HEIGHT = 64
ATOL = 1e-4  # metres: float32 of coordinates up to 8 m, divided by cosines down to GRAZING
GRAZING = 0.02  # of |ray.normal|: a ray that only touches a curved solid meets it where float32 decides


def rays_in_room(room, pose):
    """Origin (3,) and rays (n, 3) in the room's axes, float64."""
    yaw = float(room.yaw)
    heading = np.array([[np.cos(yaw), np.sin(yaw), 0], [-np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]])
    rays = np.asarray(rays_of_pose(pose, HEIGHT, 2 * HEIGHT), np.float64).reshape(-1, 3)
    return heading @ np.asarray(pose[:3, 3], np.float64), rays @ heading.T


def solids_of(room):
    """(kind, centre, half, cosine, sine, object) of every used solid, float64."""
    for kind in ("boxes", "cylinders", "ellipsoids"):
        solids = jax.tree.map(np.asarray, getattr(room, kind))
        for i in range(int(solids.count)):
            centre, half, heading = (x[i].astype(np.float64) for x in (solids.centre, solids.half, solids.heading))
            yield kind, centre, half, *heading, int(solids.object[i])


def meet(kind, origin, rays, half):
    """First t > 0 on the surface, by trying every face or root and asking whether the point lies on the solid."""
    o, d = origin / half, rays / half
    found = np.full(len(d), np.inf)

    def offer(t, on_it):
        nonlocal found
        found = np.where(on_it & (t > 0) & np.isfinite(t), np.minimum(found, t), found)

    with np.errstate(all="ignore"):
        axes = {"boxes": (0, 1, 2), "cylinders": (2,), "ellipsoids": ()}[kind]
        for axis in axes:
            for side in (-1, 1):
                t = (side - o[axis]) / d[:, axis]
                p = o + t[:, None] * d
                others = np.delete(p, axis, axis=1)
                flat = np.abs(others).max(1) <= 1 if kind == "boxes" else (others**2).sum(1) <= 1
                offer(t, flat)
        if kind != "boxes":
            n = 2 if kind == "cylinders" else 3
            a, b, c = (d[:, :n] ** 2).sum(1), d[:, :n] @ o[:n], (o[:n] ** 2).sum() - 1
            for sign in (-1, 1):
                t = (-b + sign * np.sqrt(b * b - a * c)) / a
                offer(t, np.abs((o + t[:, None] * d)[:, 2]) <= 1 if n == 2 else True)
    return found


def leave(room, origin, rays):
    """Where rays leave the union of the shell and its openings: the first face beyond which lies neither."""
    boxes = [(np.asarray(room.low, np.float64), np.asarray(room.high, np.float64))]
    for c, h in zip(np.asarray(room.openings.centre, float), np.asarray(room.openings.half, float), strict=True):
        boxes.append((c - h, c + h))
    found = np.full(len(rays), np.inf)
    with np.errstate(all="ignore"):
        for bounds in boxes:
            for axis in range(3):
                for side in bounds:
                    t = (side[axis] - origin[axis]) / rays[:, axis]
                    beyond = origin + (t[:, None] + 1e-7) * rays
                    before = origin + (t[:, None] - 1e-7) * rays
                    inside = [
                        np.any([((p >= lo) & (p <= hi)).all(1) for lo, hi in boxes], axis=0) for p in (before, beyond)
                    ]
                    found = np.where((t > 0) & inside[0] & ~inside[1], np.minimum(found, t), found)
    return found


def oracle(room, pose):
    """(distance, object id or -1 for the shell) by brute force in float64."""
    origin, rays = rays_in_room(room, pose)
    distance, ids = leave(room, origin, rays), np.full(len(rays), -1)
    for kind, centre, half, c, s, name in solids_of(room):
        own = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        t = meet(kind, own @ (origin - centre), rays @ own.T, half)
        ids, distance = np.where(t < distance, name, ids), np.minimum(distance, t)
    shape = HEIGHT, 2 * HEIGHT
    return distance.reshape(shape), ids.reshape(shape)


@pytest.mark.slow
@pytest.mark.parametrize("index", range(6))
def test_distance_is_that_of_every_primitive_tried_in_float64(index, room_of, tracer, pose_at):
    room = room_of(index)
    pose = pose_at(0.1, -0.05, 0.02, right=0.3)
    view = jax.tree.map(lambda x: np.asarray(x[0]), tracer(room, pose[None], HEIGHT))
    distance, ids = oracle(room, pose)
    rays = np.asarray(rays_of_pose(pose, HEIGHT, 2 * HEIGHT))
    slant = np.abs((view.normal * rays).sum(-1))
    wrong = np.abs(view.distance - distance) > ATOL
    # A ray through an edge may take either side; then the two surfaces' ids differ. One in a thousand at most.
    assert (wrong & (slant > GRAZING)).mean() < 1e-3
    furniture = view.object >= 10
    assert ((furniture != (ids >= 0)) | (furniture & (view.object != ids))).mean() < 1e-3


def test_open_windows_have_a_colour_and_no_distance(many_rooms, room_of, tracer, pose_at):
    index = int(jnp.argmax((many_rooms.openings.window * (jnp.abs(many_rooms.openings.centre[..., 0]) < 100)).sum(1)))
    room, pose = room_of(index), pose_at()[None]
    shut, opened = (tracer(room.replace(open_windows=jnp.array(x)), pose, HEIGHT) for x in (False, True))
    gone = np.asarray(opened.distance == 0)
    assert 0.001 < gone.mean() < 0.3
    np.testing.assert_array_equal(np.asarray(opened.distance)[~gone], np.asarray(shut.distance)[~gone])
    np.testing.assert_array_equal(opened.rgb, shut.rgb)
    # Only windows: doors, walls and furniture keep theirs.
    names = set(np.asarray(shut.object)[gone])
    assert names <= {6 + i for i in range(room.openings.wall.shape[0]) if room.openings.window[i] > 0.5}


@pytest.mark.slow
def test_the_share_of_open_windows_is_the_config_s():
    keys = jax.random.split(jax.random.key(3), 64)
    for share in (0.0, 0.5, 1.0):
        config = RoomConfig(open_windows=share)
        drawn = jax.jit(jax.vmap(lambda key, config=config: generate_room(key, config).open_windows))(keys)
        assert abs(float(drawn.mean()) - share) < 0.2  # 3 standard deviations of 64 draws


@pytest.mark.parametrize("index", range(6))
def test_every_ray_hits_and_normals_face_it(index, room_of, tracer, pose_at):
    pose = pose_at(right=1.0)
    view = jax.tree.map(lambda x: np.asarray(x[0]), tracer(room_of(index), pose[None], HEIGHT))
    assert np.isfinite(view.rgb).all() and view.rgb.min() >= 0 and view.rgb.max() <= 1
    assert view.distance.min() > 0.1 and view.distance.max() < 15  # rooms are 8 x 8 x 3.2 m at most
    np.testing.assert_allclose(np.linalg.norm(view.normal, axis=-1), 1, atol=1e-5)  # float32 rsqrt and a heading
    rays = np.asarray(rays_of_pose(pose, HEIGHT, 2 * HEIGHT))
    assert (view.normal * rays).sum(-1).max() <= 1e-6


@pytest.mark.bench
@pytest.mark.parametrize("index", range(6))
def test_distance_is_that_of_embree(index, room_of, tracer, pose_at):
    """Boxes and the shell as triangles, against an implementation that is not ours."""
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("embreex")
    room = room_of(index)
    no = jnp.int32(0)
    room = room.replace(
        cylinders=room.cylinders.replace(count=no),
        ellipsoids=room.ellipsoids.replace(count=no),
        openings=room.openings.replace(centre=jnp.full_like(room.openings.centre, -1e3)),
    )
    low, high = np.asarray(room.low, float), np.asarray(room.high, float)
    meshes = [trimesh.creation.box(bounds=[low, high])]
    for _, centre, half, c, s, _ in solids_of(room):
        placed = np.array([[c, -s, 0, centre[0]], [s, c, 0, centre[1]], [0, 0, 1, centre[2]], [0, 0, 0, 1]])
        meshes.append(trimesh.creation.box(extents=2 * half, transform=placed))
    mesh = trimesh.util.concatenate(meshes)
    pose = pose_at(0.05, 0.1, 0.03, right=0.7)
    origin, rays = rays_in_room(room, pose)
    intersector = trimesh.ray.ray_pyembree.RayMeshIntersector(mesh)
    points, ray_index, _ = intersector.intersects_location(np.tile(origin, (len(rays), 1)), rays, multiple_hits=False)
    expected = np.full(len(rays), np.nan)
    expected[ray_index] = np.linalg.norm(points - origin, axis=1)
    got = np.asarray(tracer(room, pose[None], HEIGHT).distance[0]).reshape(-1)
    assert (~(np.abs(got - expected) < ATOL)).mean() < 1e-3  # rays through an edge may take either side
