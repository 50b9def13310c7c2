"""The viewer's page: what it embeds comes out again, nothing in it can run as script, nothing is asked of a network."""

import base64
import json
import re

import numpy as np
import pytest

from rein3d_jax.io.pictures.image import encode_jpeg, encode_png
from rein3d_jax.report.floor_map import FloorMap
from rein3d_jax.report.viewer import render_viewer

SPZ = b"\x1f\x8b of a scene"  # the page checks no more than that it is gzip
SQUARE = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) / 3
PLAN = FloorMap(3 * SQUARE, SQUARE, (SQUARE[:2],), np.zeros((0, 2)))
HOSTILE = "</script><script>alert(1)</script><!-- {{walk}}"


def payload(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def test_scenes_panorama_and_plan_come_out_again():
    picture = encode_jpeg(np.zeros((16, 32, 3)))
    page = render_viewer(
        {"Coarse": SPZ + b"1", "Refined": SPZ + b"2"}, picture, PLAN, backdrop=np.float32([0.25, 0.5, 1])
    )
    data = payload(page)
    assert [(s["name"], base64.b64decode(s["spz"])) for s in data["scenes"]] == [
        ("Coarse", SPZ + b"1"),
        ("Refined", SPZ + b"2"),
    ]
    head, code = data["panorama"].split(",")
    assert head == "data:image/jpeg;base64" and base64.b64decode(code) == picture
    np.testing.assert_allclose(data["safe"], PLAN.safe, atol=0.0005)  # to the millimetre
    np.testing.assert_allclose(data["walls"], PLAN.walls)
    assert len(data["paths"]) == 1 and data["backdrop"] == [0.25, 0.5, 1]
    assert payload(render_viewer({"a": SPZ}, None, PLAN))["panorama"] is None
    assert payload(render_viewer({"a": SPZ}, encode_png(np.zeros((16, 32, 3))), PLAN))["panorama"].startswith(
        "data:image/png"
    )


def test_names_cannot_become_script():
    plain, hostile = (render_viewer({name: SPZ}, None, PLAN, title=name) for name in ("a", HOSTILE))
    assert payload(hostile)["scenes"][0]["name"] == HOSTILE
    for tag in ("<script", "</script", "<!--"):
        assert hostile.count(tag) == plain.count(tag)
    assert plain.count("<script") == plain.count("</script") == 3 and "&lt;/script&gt;" in hostile


def test_a_policy_forbids_the_network_and_nothing_names_an_address():
    page = render_viewer({"a": SPZ}, None, PLAN)
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'") and not re.search(
        r"https?:|\*|'self'|unsafe-eval'.*unsafe-eval'", policy
    )
    assert not re.search(r"""(?:src|href|url)\s*[=(]\s*["']?(?:https?:)?//""", page[: page.index("<script")])
    assert "{{" not in page[: page.index("<script")]


def test_licences_of_the_libraries_are_on_the_page():
    page = render_viewer({"a": SPZ}, None, PLAN)
    for name in ("@sparkjsdev/spark", "three", "fflate"):
        assert re.search(rf"^(.*>)?{name} \d+\.\d+\.\d+ \(MIT\)$", page, re.MULTILINE)


def test_what_is_no_scene_or_picture_is_refused():
    with pytest.raises(ValueError, match="one SPZ file or more"):
        render_viewer({}, None, PLAN)
    with pytest.raises(ValueError, match="one SPZ file or more"):
        render_viewer({"a": b"ply"}, None, PLAN)
    with pytest.raises(ValueError, match="neither JPEG nor PNG"):
        render_viewer({"a": SPZ}, b"GIF89a", PLAN)
