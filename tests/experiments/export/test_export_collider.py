"""A run's collider and navigation mesh as files: closed, upright, where the room is."""

import json

import numpy as np
import pytest
import trimesh

from experiments.export import __main__ as export


@pytest.fixture(scope="module")
def folder(run_folder, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    kinds = ["--to", "collider", "navigation", "--voxel", "0.1", "--radius", "0.3"]
    assert export.main([str(run_folder), *kinds, "--output", str(folder)]) == 0
    return folder


def z_up(mesh):
    """A mesh of a file with Y up in the world's axes."""
    x, y, z = mesh.vertices.T
    return trimesh.Trimesh(np.stack([x, -z, y], axis=1), mesh.faces, process=False)


def loaded(path):
    return {name: z_up(mesh) for name, mesh in trimesh.load_scene(path, process=False).geometry.items()}


def test_the_collider_is_closed_and_ends_at_the_rooms_walls(folder, room):
    meshes = loaded(folder / "collider.glb")
    assert list(meshes) == ["collider"]
    mesh = meshes["collider"]
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume < 0
    # The shell is told by 64 rows: 1 % of what was seen lies beyond it.
    np.testing.assert_allclose(mesh.bounds, [-room.walls, room.walls], atol=0.05)
    size = np.prod(2 * room.walls)
    chest = np.prod(room.chest[1] - room.chest[0])
    assert 0.9 * (size - 3 * chest) < -mesh.volume < size  # what the chest hides is not free


def test_its_convex_parts_are_closed(folder):
    parts = loaded(folder / "collider_parts.glb")
    assert {"floor", "front", "ceiling", "thing0_part0"} <= set(parts)
    assert all(part.is_watertight and part.volume > 0 for part in parts.values())


def test_the_navigation_mesh_and_its_polygons_are_one_floor_beside_the_chest(folder, room):
    mesh, told = loaded(folder / "navigation.glb")["navigation"], json.loads((folder / "navigation.json").read_text())
    assert (told["unit"], told["up"], told["radius"], told["height"]) == ("metres", "z", 0.3, 1.6)
    assert mesh.area == pytest.approx(told["area"], rel=1e-4) and (mesh.face_normals[:, 2] > 0.99).all()
    np.testing.assert_allclose(mesh.vertices[:, 2], told["floor"], atol=1e-6)
    assert told["floor"] == pytest.approx(-room.walls[2], abs=0.02) and told["start"] == [0, 0, told["floor"]]
    (polygon,) = told["polygons"]
    corners = np.concatenate([polygon["outline"], *polygon["holes"]])
    np.testing.assert_allclose(mesh.vertices[:, :2], corners, atol=1e-4)
    low, high = room.chest[:, :2]
    gap = np.linalg.norm(np.maximum(np.maximum(low - corners, corners - high), 0), axis=1)
    assert gap.min() > 0.2  # the chest is told by 64 rows and voxels of 10 cm
    floor = 4 * np.prod(room.walls[:2] - 0.3)
    assert 0.6 * floor < told["area"] < floor


def test_an_agent_that_fits_nowhere_is_one_line(run_folder, tmp_path, capsys):
    arguments = [str(run_folder), "--to", "navigation", "--voxel", "0.1", "--output", str(tmp_path)]
    assert export.main([*arguments, "--height", "3.5"]) == 2
    assert export.main([*arguments, "--radius", "-1"]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 2 and "can stand nowhere" in lines[0] and "radius must be in" in lines[1]
    assert not list(tmp_path.iterdir())
