"""A run's folder from elsewhere: whatever its files hold, export answers with one line that names the file."""

import io
import random
import shutil
import zipfile

import numpy as np
import pytest

from experiments.export import __main__ as export


@pytest.fixture
def folder(run_folder, tmp_path):
    return shutil.copytree(run_folder, tmp_path / "room")


def refused(capsys, folder, kind, *words):
    assert export.main([str(folder), "--to", kind]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and all(word in lines[0] for word in words), lines
    assert not list(folder.rglob("transforms.json"))


def changed(path, **arrays):
    """Puts other arrays, or other bytes, under the names that end so."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    for end, value in arrays.items():
        (name,) = [name for name in members if name.endswith(f".{end}.npy")]
        if not isinstance(value, bytes):
            stream = io.BytesIO()
            np.save(stream, value)
            value = stream.getvalue()
        members[name] = value
    with zipfile.ZipFile(path, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)


def huge(dtype):
    """The header of an array of four terabytes, and nothing after it."""
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": dtype, "fortran_order": False, "shape": (10**12,)})
    return stream.getvalue()


@pytest.mark.parametrize("name", ["read", "explore", "restore-01"])
def test_cut_short_and_flipped(folder, capsys, name):
    path, rng = folder / "stages" / f"{name}.npz", random.Random(name)
    whole = path.read_bytes()
    kind = "mesh" if name == "explore" else "nerfstudio"
    for _ in range(3):
        path.write_bytes(whole[: rng.randrange(len(whole))])
        refused(capsys, folder, kind, path.name)
    flipped = bytearray(whole)
    flipped[len(whole) // 2] ^= 255
    path.write_bytes(flipped)
    refused(capsys, folder, kind, path.name)


CASES = {
    "huge": ("read", {"rgb": huge("<f4")}, "more than it holds"),
    "flat": ("read", {"rgb": np.zeros(6, np.float32)}, "do not fit"),
    "another size": ("read", {"distance": np.ones((8, 16), np.float32)}, "do not fit"),
    "another type": ("read", {"distance": np.ones((64, 128), np.int64)}, "int64"),
    "objects": ("read", {"distance": huge("|O")}, "objects"),
    "not finite": ("read", {"rgb": np.full((64, 128, 3), np.nan, np.float32)}, "not finite"),
    "poses": ("restore-00", {"world_from_camera": np.zeros((1, 4, 4), np.float32)}, "do not fit"),
    "frames": ("restore-00", {"distance": np.zeros((2, 8, 16), np.float32)}, "do not fit"),
}


@pytest.mark.parametrize("case", CASES)
def test_wrong_shapes_sizes_and_values(folder, capsys, case):
    name, arrays, word = CASES[case]
    changed(folder / "stages" / f"{name}.npz", **arrays)
    refused(capsys, folder, "nerfstudio", f"{name}.npz", word)


@pytest.mark.parametrize("counts", [[0, 1], [9, 9999], [1]])
def test_paths_longer_than_their_buffer(folder, capsys, counts):
    changed(folder / "stages" / "explore.npz", counts=np.array(counts, np.int32))
    refused(capsys, folder, "panoramas", "explore.npz", "do not fit")


def test_a_scene_with_other_vertices_than_it_declares(folder, capsys):
    data = (folder / "scene.ply").read_bytes()
    (folder / "scene.ply").write_bytes(data.replace(b"element vertex 8192", b"element vertex 999999999999"))
    refused(capsys, folder, "spz", "scene.ply declares 999999999999 vertices")
    start = data.index(b"end_header\n") + 11
    (folder / "scene.ply").write_bytes(data[:start] + np.float32(np.nan).tobytes() + data[start + 4 :])
    refused(capsys, folder, "mesh", "scene.ply", "not finite")


def test_a_recipe_that_is_no_text(folder, capsys):
    (folder / "config.toml").write_bytes(b"\xff\xfe\x00" * 9)
    refused(capsys, folder, "spz", "config.toml")
