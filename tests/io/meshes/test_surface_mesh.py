"""The mesh of a box is the box, its fronts inward, and comes back from GLB where it was."""

import sys

import numpy as np
import pytest
import trimesh

from rein3d_jax.errors import InputError
from rein3d_jax.io.meshes.mesh_file import read_mesh
from rein3d_jax.io.meshes.surface_mesh import Surface, extract_surface, without_islands, write_glb

BOX = np.array([1.0, 0.8, 0.6])  # half sizes, metres
LOW, VOXEL, SHAPE = -1.2 * np.ones(3), 0.1, (25, 25, 25)
AXES = [LOW[a] + np.arange(SHAPE[a]) * VOXEL for a in range(3)]
PLACES = np.stack(np.meshgrid(*AXES, indexing="ij"), axis=-1)
INSIDE = (BOX - np.abs(PLACES)).min(axis=-1)  # metres to the walls, positive within
RGB = (PLACES + 1.2) / 2.4


def boxed(known=None):
    return extract_surface(INSIDE, np.ones(SHAPE, bool) if known is None else known, RGB, LOW, VOXEL)


def mesh_of(found):
    return trimesh.Trimesh(found.vertices, found.faces, process=False)


def test_the_surface_is_the_box_seen_from_within():
    found = boxed()
    np.testing.assert_allclose((BOX - np.abs(found.vertices)).min(axis=1), 0, atol=VOXEL)
    mesh = mesh_of(found)
    assert mesh.is_watertight
    # Fronts look inward: the volume that they enclose is negative. A voxel is cut off each of the twelve edges.
    np.testing.assert_allclose(mesh.volume, -8 * BOX.prod(), rtol=0.03)
    np.testing.assert_allclose(found.colours, (found.vertices + 1.2) / 2.4, atol=VOXEL / 2.4)


def test_what_nobody_saw_stays_open():
    known = PLACES[..., 0] < 0.5
    found = boxed(known)
    assert found.vertices[:, 0].max() <= 0.5 and not mesh_of(found).is_watertight
    np.testing.assert_allclose((BOX - np.abs(found.vertices)).min(axis=1), 0, atol=VOXEL)


def test_glb_round_trip(tmp_path):
    found = boxed()
    write_glb(tmp_path / "x.glb", found)
    raw = trimesh.load(tmp_path / "x.glb", force="mesh", process=False)
    np.testing.assert_allclose(np.ptp(raw.vertices, axis=0), 2 * BOX[[0, 2, 1]], atol=0.01)  # Y is up in the file
    soup = read_mesh(tmp_path / "x.glb")  # Z up again
    corners = found.vertices[found.faces]
    area = np.linalg.norm(np.cross(*np.moveaxis(corners[:, 1:] - corners[:, :1], 1, 0)), axis=1)
    np.testing.assert_allclose(soup.corners, corners[area > 1e-12], atol=1e-6)  # float32
    wanted = found.colours[found.faces].mean(axis=1)[area > 1e-12]
    np.testing.assert_allclose(soup.colour, wanted, atol=0.05)  # 8 bits of linear light are coarse where it is dark
    assert list(tmp_path.iterdir()) == [tmp_path / "x.glb"]


def test_loose_parts_are_dropped():
    found, count = boxed(), len(boxed().vertices)
    speck = np.array([[3.0, 0, 0], [3.1, 0, 0], [3.0, 0.1, 0]])
    both = Surface(
        np.vstack([found.vertices, speck]), np.vstack([found.faces, [[count, count + 1, count + 2]]]),
        np.vstack([found.colours, np.zeros((3, 3))]),
    )  # fmt: skip
    kept = without_islands(both, 0.05)
    np.testing.assert_allclose(mesh_of(kept).volume, mesh_of(found).volume)
    assert kept.vertices[:, 0].max() < 1.1 and len(kept.vertices) == count == len(kept.colours)
    assert len(without_islands(both, 0.001).vertices) == count + 3
    with pytest.raises(InputError, match="lower --island"):
        without_islands(both, 1000.0)


def test_no_surface():
    for signed, known in ((np.abs(INSIDE) + 1, True), (INSIDE, False)):
        with pytest.raises(InputError, match="no surface"):
            extract_surface(signed, np.full(SHAPE, known), RGB, LOW, VOXEL)


@pytest.mark.parametrize("missing", ["skimage.measure", "trimesh"])
def test_a_missing_extra_is_named(monkeypatch, missing, tmp_path):
    found = boxed()
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(InputError, match=r"pip install 'rein3d-jax\[export\]'"):
        boxed() if missing == "skimage.measure" else write_glb(tmp_path / "x.glb", found)
