"""The house's rules, held by reading every file: who may import whom, each outside dependency's home,
names, sizes, docstrings."""

import ast
import collections
import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
FILES = sorted(path for room in ("rein3d_jax", "experiments") for path in (ROOT / room).rglob("*.py"))
STAGES = {"depth", "lift", "explore", "peel", "rasterize", "restore", "upsample", "refine", "evaluate", "rooms"}
GROUND = {"", "conventions", "errors", "settings"}  # "" is the package itself: its version
MAX_LINES = 250
NAMELESS = {"utils", "util", "helpers", "helper", "common", "misc"}

MAX_MODULES = 16  # in a folder
MAX_PARAMETERS = 6  # of a function; a struct beyond that
PER_COMMAND = {"main"}  # every command has one

# Room -> the rooms that it may import besides itself and GROUND. Stages know neither files nor devices.
MAY_IMPORT = {
    "scene": set(),
    "geometry": {"scene"},
    **{stage: {"scene", "geometry", "rasterize"} for stage in STAGES},
    "meshes": {"scene", "geometry"},
    "io": {"scene", "geometry", "meshes"},
    "parallel": {"scene"},
    "networks": {"io", "depth", "restore", "upsample"},
    "pipeline": {"scene", "geometry", "parallel", *STAGES},
    "report": {"scene", "geometry", "evaluate"},
    "experiments": {"scene", "geometry", "meshes", "io", "networks", "parallel", "pipeline", "report", *STAGES},
}

# Outside dependency -> where it may be imported: a folder, or a file. What is not named here has no home.
HOMES = {
    "jax": ("rein3d_jax/", "experiments/"),
    "numpy": ("rein3d_jax/", "experiments/"),
    "flax.struct": ("rein3d_jax/", "experiments/"),
    "flax.linen": ("rein3d_jax/depth/", "rein3d_jax/restore/", "rein3d_jax/upsample/"),
    "optax": ("rein3d_jax/refine/", "experiments/"),
    "jaxopt": ("rein3d_jax/depth/",),
    "cv2": ("rein3d_jax/io/", "rein3d_jax/meshes/", "rein3d_jax/restore/fills.py"),
    "OpenImageIO": ("rein3d_jax/io/pictures/", "experiments/render_rooms/blender/"),
    "av": ("rein3d_jax/io/pictures/video.py",),
    "orbax": ("rein3d_jax/io/files/",),
    "trimesh": ("rein3d_jax/io/meshes/",),
    "pxr": ("rein3d_jax/io/exports/usd.py",),
    "zstandard": ("rein3d_jax/io/splats/spz_streams.py",),
    "skimage": ("rein3d_jax/io/meshes/surface_mesh.py", "rein3d_jax/meshes/collider.py"),
    "manifold3d": ("rein3d_jax/meshes/solid.py",),
    "vhacdx": ("rein3d_jax/meshes/convex_parts.py",),
    "PIL": ("rein3d_jax/io/pictures/colour_profile.py", "rein3d_jax/io/meshes/"),  # trimesh's pictures
    "safetensors": ("rein3d_jax/io/weights/",),
    "matplotlib": ("experiments/evaluate/chart.py", "experiments/ablate/chart.py"),
    "array_record": ("rein3d_jax/io/pairs/",),
    "ray": ("experiments/build_dataset/ray_workers.py",),
    "tensorboardX": ("rein3d_jax/io/files/training_log.py",),
    "embreex": ("rein3d_jax/meshes/ray_caster.py",),
    "bpy": ("experiments/render_rooms/blender/",),  # Blender's own Python
    "rich": ("experiments/",),
}


def room_of(path: str) -> str:
    """rein3d_jax/lift/edges.py -> lift; rein3d_jax/scene.py -> scene; experiments/view/pages.py -> experiments."""
    parts = path.removesuffix(".py").removesuffix("/__init__").split("/")
    return parts[0] if parts[0] != "rein3d_jax" else "".join(parts[1:2])


def allowed_rooms(room: str) -> set[str]:
    """The rooms that `room` may import besides itself."""
    return GROUND | MAY_IMPORT.get(room, set())


def imports(tree: ast.AST) -> set[str]:
    """Dotted names of all that a module imports, wherever in it: `from a import b` counts as a.b."""
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "imports are absolute here"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def import_faults(path: str, source: str) -> list[str]:
    """What `source` at `path` imports against the rules."""
    room, faults = room_of(path), []
    for name in sorted(imports(ast.parse(source))):
        top, *below = name.split(".")
        if top in ("rein3d_jax", "experiments"):
            inner = room_of(f"{top}/{'/'.join(below)}.py")
            inner = "" if inner.startswith("__") else inner
            if inner != room and inner not in allowed_rooms(room):
                faults.append(f"{path} ({room}) imports {name} ({inner})")
        elif top not in sys.stdlib_module_names and not _at_home(path, name):
            faults.append(f"{path} imports {name}, whose home is {homes(name) or 'nowhere'}")
    return faults


def homes(name: str) -> tuple[str, ...]:
    """Where the outside dependency `name` may be imported: by the longest known part of its dotted name."""
    known = [key for key in HOMES if f"{name}.".startswith(f"{key}.")]
    return HOMES[max(known, key=len)] if known else ()


def _at_home(path: str, name: str) -> bool:
    return any(path == home or (home.endswith("/") and path.startswith(home)) for home in homes(name))


def docstring_faults(path: str, source: str) -> list[str]:
    """The module and its public functions that say nothing."""
    tree = ast.parse(source)
    public = [node for node in tree.body if isinstance(node, ast.FunctionDef) and not node.name.startswith("_")]
    faults = [f"{path}: {node.name} has no docstring" for node in public if not ast.get_docstring(node)]
    return faults if ast.get_docstring(tree) else [f"{path} has no docstring", *faults]


def size_and_name_faults(path: str, source: str) -> list[str]:
    """Files too long to be one concept, or named after none."""
    lines = source.count("\n")
    faults = [f"{path} has {lines} lines; {MAX_LINES} are the most"] if lines > MAX_LINES else []
    nameless = NAMELESS & set(re.split(r"[/._]", path))
    return faults + [f"{path}: {word} names no concept" for word in sorted(nameless)]


def parameter_faults(path: str, source: str) -> list[str]:
    """Functions of more than MAX_PARAMETERS parameters."""
    faults = []
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.FunctionDef):
            a = node.args
            named = [x for x in (*a.posonlyargs, *a.args, *a.kwonlyargs, a.vararg, a.kwarg) if x is not None]
            count = len([x for x in named if x.arg not in ("self", "cls")])
            if count > MAX_PARAMETERS:
                faults.append(f"{path}: {node.name} has {count} parameters; {MAX_PARAMETERS} are the most")
    return faults


def config_faults(path: str, source: str) -> list[str]:
    """Config classes, the first thing that a user reads, without a docstring."""
    classes = [node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ClassDef)]
    silent = [node.name for node in classes if node.name.endswith("Config") and not ast.get_docstring(node)]
    return [f"{path}: {name} has no docstring" for name in silent]


def public_names(source: str) -> set[str]:
    """The names that a module defines at its top level for others."""
    names = set()
    for node in ast.parse(source).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names |= {target.id for target in node.targets if isinstance(target, ast.Name)}
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            names.add(node.target.id)
    return {name for name in names if not name.startswith("_")} - PER_COMMAND


def name_clashes(sources: dict[str, str]) -> list[str]:
    """Public names that stand in two modules."""
    where = {}
    for path, source in sources.items():
        for name in public_names(source):
            where.setdefault(name, []).append(path)
    return [f"{name} stands in {' and '.join(paths)}" for name, paths in sorted(where.items()) if len(paths) > 1]


@pytest.mark.parametrize(
    "check", [import_faults, docstring_faults, size_and_name_faults, parameter_faults, config_faults]
)
def test_every_file_keeps_the_rules(check):
    assert FILES
    faults = [fault for file in FILES for fault in check(file.relative_to(ROOT).as_posix(), file.read_text("utf-8"))]
    assert not faults, "\n".join(faults)


def test_a_public_name_stands_once():
    faults = name_clashes({file.relative_to(ROOT).as_posix(): file.read_text("utf-8") for file in FILES})
    assert not faults, "\n".join(faults)


def test_no_folder_is_crowded():
    """A newcomer sees a folder at a glance."""
    tops = ("rein3d_jax", "experiments", "benchmarks", "tests")
    modules = [file for top in tops for file in (ROOT / top).rglob("*.py")]
    counts = collections.Counter(file.parent for file in modules if file.name != "__init__.py")
    assert not {folder: count for folder, count in counts.items() if count > MAX_MODULES}


def test_every_folder_of_code_is_a_package():
    """Without __init__.py the wheel would leave it out."""
    folders = {parent for file in FILES for parent in file.parents if ROOT in parent.parents}
    assert not [folder for folder in folders if not (folder / "__init__.py").exists()]


def test_every_room_is_known():
    rooms = {room_of(file.relative_to(ROOT).as_posix()) for file in FILES}
    assert rooms <= {*GROUND, *MAY_IMPORT}


@pytest.mark.parametrize(
    ("path", "line", "caught"),
    [
        ("rein3d_jax/lift/lift.py", "from rein3d_jax.scene import Gaussians", False),
        ("rein3d_jax/lift/lift.py", "from rein3d_jax.lift.edges import edges", False),
        ("rein3d_jax/lift/lift.py", "from rein3d_jax import geometry", False),
        ("rein3d_jax/refine/step.py", "import rein3d_jax.rasterize.tile", False),
        ("rein3d_jax/io/files/atomic.py", "import os, tempfile, numpy as np", False),
        ("experiments/reconstruct/__main__.py", "from rein3d_jax import __version__", False),
        ("experiments/reconstruct/__main__.py", "from rein3d_jax.io.splats import ply", False),
        ("rein3d_jax/lift/lift.py", "from rein3d_jax.io.splats.ply import write", True),
        ("rein3d_jax/lift/lift.py", "from rein3d_jax import io", True),
        ("rein3d_jax/lift/lift.py", "def f():\n    import rein3d_jax.explore", True),
        ("rein3d_jax/refine/step.py", "from rein3d_jax.evaluate.metrics import ssim", True),
        ("rein3d_jax/geometry/safe.py", "from rein3d_jax.lift import lift", True),
        ("rein3d_jax/scene.py", "from rein3d_jax.geometry import safe", True),
        ("rein3d_jax/conventions.py", "from rein3d_jax.scene import Camera", True),
        ("rein3d_jax/io/splats/ply.py", "from rein3d_jax.geometry import safe", False),
        ("rein3d_jax/io/splats/ply.py", "from rein3d_jax.lift import lift", True),
        ("rein3d_jax/meshes/texture.py", "from rein3d_jax.io.pictures import image", True),
        ("rein3d_jax/report/chart.py", "from rein3d_jax.evaluate.metrics import psnr", False),
        ("rein3d_jax/report/chart.py", "from rein3d_jax.io.pictures.image import encode_jpeg", True),
        ("rein3d_jax/pipeline/devices.py", "from rein3d_jax.parallel import data_parallel", False),
        ("rein3d_jax/pipeline/devices.py", "from rein3d_jax.io.splats.ply import write_ply", True),
        ("rein3d_jax/lift/lift.py", "from rein3d_jax.pipeline.stages import Stages", True),
        ("rein3d_jax/rasterize/tile.py", "from experiments.config import load_config", True),
        ("rein3d_jax/restore/fills.py", "import cv2", False),
        ("rein3d_jax/restore/push_pull.py", "import cv2", True),
        ("rein3d_jax/depth/room_shell.py", "from jaxopt import LBFGS", False),
        ("rein3d_jax/refine/step.py", "import jaxopt", True),
        ("rein3d_jax/rasterize/tile.py", "from flax import struct", False),
        ("rein3d_jax/rasterize/tile.py", "from flax import linen as nn", True),
        ("rein3d_jax/io/pictures/image.py", "import orbax.checkpoint as ocp", True),
        ("rein3d_jax/lift/lift.py", "import torch", True),
        ("rein3d_jax/lift/lift.py", "import averages", True),  # begins like "av", which lives elsewhere too
    ],
)
def test_the_import_check_tells_right_from_wrong(path, line, caught):
    assert bool(import_faults(path, line)) == caught


def test_the_other_checks_catch_what_they_should():
    assert docstring_faults("a.py", "def f(): pass") == ["a.py has no docstring", "a.py: f has no docstring"]
    assert not docstring_faults("a.py", '"""A."""\ndef _f(): pass\ndef g():\n    """G."""')
    assert config_faults("a.py", "class AConfig: pass") == ["a.py: AConfig has no docstring"]
    assert not parameter_faults("a.py", "def f(self, a, b, c, d, e, *, f): pass")
    assert parameter_faults("a.py", "def f(a, b, c, d, e, *f, g): pass") == ["a.py: f has 7 parameters; 6 are the most"]
    names = {"a.py": "A = 1\n_B = 2", "b.py": "def A(): pass", "c.py": "_B: int = 3\ndef main(): pass"}
    assert name_clashes(names) == ["A stands in a.py and b.py"]
    assert size_and_name_faults("rein3d_jax/lift/depth_utils.py", "\n" * 251) == [
        "rein3d_jax/lift/depth_utils.py has 251 lines; 250 are the most",
        "rein3d_jax/lift/depth_utils.py: utils names no concept",
    ]
