"""A run served: on the loopback interface alone, its pages and nothing else, progress until it is done."""

import http.client
import json
import os
import re
import shutil
import threading
from contextlib import contextmanager

import html5lib
import numpy as np
import pytest

from experiments.config import dump_config, recipe_digest
from experiments.run_folder import open_run
from experiments.view import __main__ as view
from experiments.view.pages import pages
from experiments.view.server import LOOPBACK, server
from rein3d_jax.io.files.checkpoint import save
from rein3d_jax.io.splats.spz import encode_spz
from rein3d_jax.refine import blank_snapshot

DATA = re.compile(r'<script type="application/json" id="data">(.*?)</script>', re.DOTALL)


@pytest.fixture
def folder(run_folder, tmp_path):
    """A run that is done."""
    shutil.copytree(run_folder, tmp_path / "room")
    (tmp_path / "room" / "metrics.json").write_text("{}")
    (tmp_path / "secret.txt").write_text("secret")
    return tmp_path / "room"


@contextmanager
def serving(folder):
    """A function that asks the running server: path -> (status, headers, body)."""
    with server(pages(open_run(folder)), 0) as running:
        thread = threading.Thread(target=running.serve_forever)
        thread.start()

        def ask(path, host=None, method="GET"):
            connection = http.client.HTTPConnection(LOOPBACK, running.server_port, timeout=60)
            connection.putrequest(method, path, skip_host=True)
            connection.putheader("Host", host or f"{LOOPBACK}:{running.server_port}")
            connection.endheaders()
            answer = connection.getresponse()
            return answer.status, dict(answer.getheaders()), answer.read()

        try:
            yield ask
        finally:
            running.shutdown()
            thread.join()


def test_it_is_bound_to_loopback(folder):
    with server(pages(open_run(folder)), 0) as running:
        assert running.server_address[0] == "127.0.0.1"


def test_a_finished_run_is_shown_in_the_viewer(folder):
    with serving(folder) as ask:
        status, headers, page = ask("/")
        assert status == 200 and headers["Content-Type"] == "text/html; charset=utf-8"
        data = json.loads(DATA.search(page.decode())[1])
        assert data["scenes"] == [
            {"name": "Coarse", "url": "/coarse.spz"}, {"name": "Refined", "url": "/refined.spz"}
        ]  # fmt: skip
        assert data["safe"] and data["panorama"].startswith("data:image/jpeg")
        run = open_run(folder)
        assert ask("/coarse.spz")[2] == encode_spz(run.coarse) and ask("/refined.spz")[2] == encode_spz(run.refined)
        assert ask("/scene.ply?download")[2] == (folder / "scene.ply").read_bytes()
        assert ask("/sofar.spz")[0] == 404  # its file is not there


@pytest.mark.parametrize(
    "path",
    [
        "/../secret.txt", "/stages/../../secret.txt", "/%2e%2e/secret.txt", "//etc/passwd", "/config.toml", "/stages/",
        "/..\\secret.txt", "/scene.ply/", "/scene.ply%00", "http://127.0.0.1/../secret.txt", "/" + "a" * 9000, "*",
    ],
)  # fmt: skip
def test_nothing_else_is_served(folder, path):
    with serving(folder) as ask:
        status, _, body = ask(path)
        assert status == 404 and b"secret" not in body and b"root:" not in body


def test_other_methods_and_other_names_are_refused(folder):
    with serving(folder) as ask:
        for method in ("POST", "PUT", "DELETE"):
            assert ask("/", method=method)[0] == 501
        assert ask("/", host="evil.example:80")[0] == 403  # a name that was made to resolve here
        assert ask("/report.html", host="localhost")[0] == 404  # this run wrote none


def begun_again(folder, stages):
    """The folder of a job that has just finished its first `stages`."""
    names = ["read", "lift", "explore", "peel", "restore-00", "restore-01"]
    (folder / "metrics.json").unlink()
    for name in names[stages:]:
        (folder / "stages" / f"{name}.npz").unlink()
    for name in names[:stages]:
        later = (folder / "config.toml").stat().st_mtime_ns + 10**9
        os.utime(folder / "stages" / f"{name}.npz", ns=(later, later))


def test_a_running_job_shows_how_far_it_is(folder):
    begun_again(folder, stages=5)
    with serving(folder) as ask:
        page = ask("/")[2].decode()
        html5lib.HTMLParser(strict=True).parse(page)
        states = re.findall(r"<td>([^<]*)</td><td>([^<]*)</td>", page)
        assert states == [("read", "done"), ("lift", "done"), ("explore", "done"), ("peel", "done"),
                          ("restore-00", "done"), ("restore-01", "waiting"), ("refine", "waiting")]  # fmt: skip
        assert 'http-equiv="refresh"' in page and "<polyline" not in page
        scenes = json.loads(DATA.search(ask("/viewer")[2].decode())[1])["scenes"]
        assert [scene["name"] for scene in scenes] == ["Coarse"]
        begun = (folder / "config.toml").stat().st_mtime_ns
        os.utime(folder / "stages" / "read.npz", ns=(begun - 10**9, begun - 10**9))
        assert "<td>read</td><td>done by an earlier job</td>" in ask("/")[2].decode()


def test_a_job_of_another_recipe_over_a_finished_one_is_not_finished(folder):
    (folder / "metrics.json").write_text(json.dumps({"recipe": recipe_digest(folder / "config.toml")}))
    assert open_run(folder).finished
    with open(folder / "config.toml", "a") as file:
        file.write("# begun again\n")
    assert not open_run(folder).finished


def test_before_there_is_a_scene_there_is_no_viewer(folder):
    begun_again(folder, stages=5)
    for name in ("lift", "explore", "peel", "restore-00"):
        (folder / "stages" / f"{name}.npz").unlink()
    with serving(folder) as ask:
        assert "/viewer" not in ask("/")[2].decode()
        assert ask("/viewer")[0] == 404 and ask("/coarse.spz")[0] == 404


def test_refinement_so_far_is_drawn_and_shown(folder):
    begun_again(folder, stages=6)
    snapshot = blank_snapshot(open_run(folder).config.refine)
    values = {"loss": [0.5, 0.2], "psnr": [20.0, 22.0], "count": [100.0, 90.0]}
    curves = snapshot.curves.replace(**{name: np.array([[0.0, a], [50.0, b]]) for name, (a, b) in values.items()})
    stored = {"key": np.zeros(32, np.uint8), "result": snapshot.replace(curves=curves), "seconds": np.float64(0)}
    save(folder / "stages" / "unfinished.npz", stored)
    with serving(folder) as ask:
        page = ask("/")[2].decode()
        html5lib.HTMLParser(strict=True).parse(page)
        assert page.count("<polyline") == 3
        scenes = json.loads(DATA.search(ask("/viewer")[2].decode())[1])["scenes"]
        assert scenes[-1] == {"name": "So far", "url": "/sofar.spz"}
        assert ask("/sofar.spz")[2].startswith(b"\x1f\x8b")
        (folder / "stages" / "unfinished.npz").write_bytes(b"damaged")
        assert ask("/")[0] == 200 and ask("/sofar.spz")[0] == 404


def test_faults_are_one_line(folder, tmp_path, capsys):
    for arguments, word in (
        ([str(tmp_path / "nowhere")], "is no run's folder"),
        ([str(folder), "--port", "99999"], "--port 99999"),
    ):
        assert view.main(arguments) == 2
        lines = capsys.readouterr().err.strip().splitlines()
        assert len(lines) == 1 and word in lines[0]
    with server({}, 0) as taken:
        assert view.main([str(folder), "--port", str(taken.server_port)]) == 2
        assert "give another" in capsys.readouterr().err


def test_a_folder_with_a_hostile_name_is_text(folder, tmp_path):
    begun_again(folder, stages=1)
    hostile = tmp_path / "<script>alert(1)<"
    folder.rename(hostile)
    (hostile / "config.toml").write_text(dump_config(open_run(hostile).config))
    with serving(hostile) as ask:
        page = ask("/")[2].decode()
    assert "<script" not in page and "&lt;script&gt;" in page
