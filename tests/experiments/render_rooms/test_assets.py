"""Catalogs are unpacked once and read as metres; what is missing is said in one line with its mend."""

import zipfile

import pytest

from experiments.render_rooms.__main__ import main, worker_seeds
from experiments.render_rooms.assets import load_catalog, pick_model
from experiments.render_rooms.blender_process import BlenderProcess
from experiments.render_rooms.kinds import MODEL_KINDS
from rein3d_jax.errors import InputError

_SOFA = """id#1=Scopia#beige_sofa
name#1=Sofa
category#1=Living room
model#1=/scopia/beige_sofa/beige_sofa.obj
width#1=223.4
depth#1=74
height#1=87.9
dropOnTopElevation#1=41.4
elevation#1=10
modelRotation#1=0 0 -1 0 1 0 1 0 0
creator#1=Scopia
"""
_TEXTURE = "id#1=eTeks#woodenFloor\nname#1=Wood\ncategory#1=Floor\nimage#1=/a/wood.jpg\nwidth#1=42.5\nheight#1=42.5\n"


@pytest.fixture
def folder(tmp_path):
    share = "usr/share/sweethome3d"
    furniture = tmp_path / "sweethome3d-furniture" / share / "furniture"
    furniture.mkdir(parents=True)
    for library in ("Scopia", "KatorLegaz", "BlendSwap-CC-BY", "BlendSwap-CC-0"):
        with zipfile.ZipFile(furniture / f"{library}.sh3f", "w") as archive:
            archive.writestr("PluginFurnitureCatalog.properties", _SOFA if library == "Scopia" else "")
    jar = tmp_path / "sweethome3d" / share / "sweethome3d.jar"
    jar.parent.mkdir(parents=True)
    with zipfile.ZipFile(jar, "w") as archive:
        archive.writestr("com/eteks/sweethome3d/io/DefaultTexturesCatalog.properties", _TEXTURE)
        archive.writestr("other/thing.class", "")
    return tmp_path


def test_catalogs_are_read_in_metres_with_their_licence(folder):
    catalog = load_catalog(folder)
    (sofa,) = catalog.models["sofa"]
    assert sofa.size == pytest.approx((2.234, 0.74, 0.879))
    assert (sofa.top, sofa.elevation) == (pytest.approx(0.414), pytest.approx(0.1))
    assert sofa.rotation == (0, 0, -1, 0, 1, 0, 1, 0, 0)
    assert sofa.credit[3] == "CC-BY 3.0"
    assert catalog.textures[0].size == (0.425, 0.425)
    assert not (folder / "textures" / "other").exists()
    assert load_catalog(folder) == catalog  # from what was unpacked


def test_a_model_that_is_too_large_is_not_picked(folder):
    catalog = load_catalog(folder)
    assert pick_model(None, catalog, "sofa", (1.0, 1.0, 1.0)) is None


def test_no_kind_names_a_model_twice():
    for kind, keys in MODEL_KINDS.items():
        assert len(set(keys.split())) == len(keys.split()), kind


def test_missing_packages_are_named(tmp_path, capsys):
    with pytest.raises(InputError, match="apt-get download"):
        load_catalog(tmp_path)
    assert main(["--output", str(tmp_path), "--assets", str(tmp_path), "--blender", "/nowhere/bin/python"]) == 2
    assert "apt-get download" in capsys.readouterr().err


def test_a_missing_blender_is_named(tmp_path):
    with pytest.raises(InputError, match="pip install -r"):
        BlenderProcess(tmp_path / "bin" / "python", tmp_path / "log")


def test_workers_share_the_seeds():
    parts = [list(worker_seeds(f"{i}/3", 5, 10)) for i in range(3)]
    assert sorted(seed for part in parts for seed in part) == list(range(5, 15))
    for wrong in ("3/3", "1", "a/b", "-1/2"):
        with pytest.raises(InputError, match="I/N"):
            worker_seeds(wrong, 0, 1)
