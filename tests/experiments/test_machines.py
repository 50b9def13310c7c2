"""What machines do to a command: it ends with one line and an exit code, or goes on; never with a traceback."""

import errno
import io
import os
import signal
import subprocess
import sys
from pathlib import Path

import jax
import pytest

from experiments import compile_cache, machine
from experiments.command import CommandParser
from experiments.config import load_config
from experiments.reconstruct.__main__ import _overrides
from experiments.reconstruct.config import ReconstructConfig
from experiments.reconstruct.progress import Progress
from experiments.reconstruct.stage_store import Finished

ROOT = Path(__file__).resolve().parents[2]
ALLOCATION = "RESOURCE_EXHAUSTED: Out of memory allocating 1384170208 bytes."


@pytest.fixture(autouse=True)
def settings():
    """Tests change how this process's JAX is set up: it is put back."""
    names = ("jax_enable_x64", "jax_platforms", "jax_compilation_cache_dir")
    before = {name: getattr(jax.config, name) for name in names}
    yield
    for name, value in before.items():
        jax.config.update(name, value)


def run(work, *, resume=False):
    parser = CommandParser("wall", "A wall is built.")
    parser.lighter = "lower wall.height"
    if resume:
        parser.add_argument("--resume", action="store_true")
    return parser.run(work, [])


def raising(error):
    def work(_):
        raise error

    return work


def script(body, **environment):
    """A process whose command `wall` does `body`."""
    code = f"""
import signal, sys, threading, time
from concurrent.futures import ThreadPoolExecutor
from experiments.command import CommandParser
def work(options):
{"".join(f"    {line}{chr(10)}" for line in body.splitlines())}
sys.exit(CommandParser("wall", "A wall.").run(work, []))
"""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment = {**os.environ, **environment}
    # Tests in the background of a shell have Ctrl-C ignored, and hand that on.
    return subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, env=environment, preexec_fn=_heeds_ctrl_c, **pipes)


def _heeds_ctrl_c():
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize(
    "error", [MemoryError("std::bad_alloc"), MemoryError(), jax.errors.JaxRuntimeError(ALLOCATION)]
)
def test_out_of_memory_is_one_line_that_says_what_to_lower(error, capsys):
    assert run(raising(error)) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("wall: out of memory with ") and " GB in use (" in line
    assert line.endswith(": lower wall.height") and str(error) in line


def test_a_full_disk_is_one_line_that_names_the_file(capsys):
    assert run(raising(OSError(errno.ENOSPC, "No space left on device", "wall.log"))) == 2
    expected = "wall: wall.log cannot be written (No space left on device): free some space there\n"
    assert capsys.readouterr().err == expected


@pytest.mark.parametrize("error", [RuntimeError("shapes differ"), OSError(errno.EIO, "broken"), AssertionError()])
def test_a_bug_is_not_hidden(error):
    with pytest.raises(type(error)):
        run(raising(error))


@pytest.mark.parametrize(("resume", "how"), [(True, "with --resume"), (False, "again")])
def test_ctrl_c_is_one_line_that_says_how_to_go_on(resume, how, capsys):
    assert run(raising(KeyboardInterrupt()), resume=resume) == 130
    assert capsys.readouterr().err == f"wall: interrupted: run the same command {how} to go on\n"


@pytest.mark.parametrize(
    "body",
    [
        "print('at work', flush=True)\ntime.sleep(60)",
        # A worker thread that nobody can interrupt: without help the process would wait for it.
        "with ThreadPoolExecutor(1) as beside:\n"
        "    beside.submit(time.sleep, 60)\n    print('at work', flush=True)\n    time.sleep(60)",
    ],
)
def test_ctrl_c_ends_a_process_soon(body):
    with script(body) as process:
        assert process.stdout.readline() == "at work\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)  # 3 s of grace, on a machine with other work; it would sleep for 60
    assert process.returncode == 130
    assert said == "wall: interrupted: run the same command again to go on\n"


AS_SCRIPT = "import sys; sys.argv = ['bin/rein3d', 'reconstruct']; from experiments.__main__ import main; main()"


@pytest.mark.parametrize("arguments", [("-m", "experiments.reconstruct"), ("-c", AS_SCRIPT)])
def test_ctrl_c_among_the_imports_is_one_line(arguments, tmp_path):
    (tmp_path / "jax.py").write_text("import time\nprint('importing', flush=True)\ntime.sleep(60)\n")
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    environment, command = {**os.environ, "PYTHONPATH": str(tmp_path)}, [sys.executable, *arguments]
    with subprocess.Popen(command, cwd=ROOT, env=environment, preexec_fn=_heeds_ctrl_c, **pipes) as process:
        assert process.stdout.readline() == "importing\n"
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=30)
    assert (process.returncode, said) == (130, "interrupted before anything was begun\n")


def test_a_library_leaves_ctrl_c_alone():
    check = "import signal, experiments.interrupt; assert signal.getsignal(2) is signal.default_int_handler"
    with subprocess.Popen([sys.executable, "-c", check], cwd=ROOT, preexec_fn=_heeds_ctrl_c) as process:
        assert process.wait(30) == 0


def test_a_platform_that_is_not_there_is_named():
    with script("import jax.numpy as jnp\njnp.zeros(3)", JAX_PLATFORMS="cuda,nonsense") as process:
        _, said = process.communicate(timeout=60)
    assert process.returncode == 2 and said.count("\n") == 1
    assert said.startswith("wall: JAX_PLATFORMS=cuda,nonsense names a platform that JAX cannot start here: unset ")


def test_double_precision_is_refused_before_anything_is_done(capsys):
    jax.config.update("jax_enable_x64", True)
    assert run(raising(AssertionError("it began"))) == 2
    assert capsys.readouterr().err.startswith("wall: JAX_ENABLE_X64 is set")


def no_home():
    raise RuntimeError("Could not determine home directory.")


def test_without_a_home_programs_are_not_kept(monkeypatch, capsys):
    jax.config.update("jax_compilation_cache_dir", None)
    monkeypatch.setattr(Path, "home", no_home)
    assert run(lambda _: None) == 0
    assert jax.config.jax_compilation_cache_dir is None
    assert capsys.readouterr().err.count("\n") == 1


def test_programs_are_kept_where_they_can_be(tmp_path, capsys):
    (tmp_path / "file").write_text("no folder")
    for folder, kept in ((tmp_path / "new" / "folder", True), (tmp_path / "file" / "folder", False)):
        jax.config.update("jax_compilation_cache_dir", str(folder))
        compile_cache.use_compile_cache()
        assert jax.config.jax_compilation_cache_dir == (str(folder) if kept else None)
        assert (f"{folder} cannot be written" in capsys.readouterr().err) == (not kept)
    jax.config.update("jax_compilation_cache_dir", "gs://bucket/programs")  # JAX writes there itself
    compile_cache.use_compile_cache()
    assert jax.config.jax_compilation_cache_dir == "gs://bucket/programs"


def test_a_container_has_what_it_was_given(tmp_path, monkeypatch):
    whole, limit = machine.machine_bytes(), tmp_path / "memory.max"
    monkeypatch.setattr(machine, "_CONTAINER", (tmp_path / "none", limit))
    for said, expected in (("max\n", whole), ("1000000\n", 1_000_000), (f"{2**62}\n", whole)):
        limit.write_text(said)
        assert machine.machine_bytes() == expected


def test_a_limit_on_addresses_is_counted(monkeypatch):
    given = 5 * 10**9
    monkeypatch.setattr(machine.resource, "getrlimit", lambda _: (given, given))
    assert machine.machine_bytes() < given


def test_a_console_escapes_what_it_cannot_print(monkeypatch):
    written = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "ascii"))
    assert run(lambda _: print("open Zimmer ü", flush=True)) == 0
    assert written.getvalue() == b"open Zimmer \\xfc\n"


def test_a_log_has_lines_alone(monkeypatch, capsys):
    """Whatever FORCE_COLOR says; and a folder is printed as it is called."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    foreseen = {"foreseen_seconds": {"total": 2.0, "lift": 1.0}, "foreseen_bytes": 2**30}
    with Progress(ReconstructConfig(), **foreseen) as progress:
        progress.done(Finished("lift", 1.0, False, {}))
        progress.look(Path("[b] :smile: ü"))
    told, lift, look = capsys.readouterr().out.splitlines()
    assert told == "this will take about 2 s and 1.0 GiB of memory" and lift == "lift         1.0 s"
    assert look.startswith("open [b] :smile: ü/viewer.html ") or look.startswith('open "[b] :smile: ü')


@pytest.mark.parametrize("name", ["Zimmer ü", "部屋", "room \U0001f6cb", 'a "b" \\c'])
def test_a_folder_may_have_any_name(name):
    parser = CommandParser("wall", "A wall.")
    for option in ("panorama", "--input", "--distance", "--output"):
        parser.add_argument(option, **({"nargs": "?"} if option == "panorama" else {}))
    parser.add_recipe(ReconstructConfig, default="quick")
    options = parser.parse_args([f"{name}/a.png", "--output", name, "--distance", f"{name}/d.exr"])
    config = load_config(ReconstructConfig, options.config, _overrides(options))
    assert (config.output, config.input.panorama, config.input.distance) == (name, f"{name}/a.png", f"{name}/d.exr")


def test_no_command_starts_a_device_before_its_arguments_are_read():
    """Or JAX_PLATFORMS at fault would be a traceback, and several hosts could not be joined."""
    names = ("reconstruct", "view", "export", "evaluate", "build_dataset", "estimate_distance", "build_examples")
    imports = "; ".join(f"import experiments.{name}.__main__" for name in names)
    check = "from jax._src import xla_bridge; assert not xla_bridge.backends_are_initialized()"
    subprocess.run([sys.executable, "-c", f"{imports}; {check}"], check=True)
