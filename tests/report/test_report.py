"""The page holds what it was given, harmless, and asks nothing of the network; its drawings keep their orientation."""

import base64
import dataclasses
import re
import xml.etree.ElementTree as ElementTree
from html.parser import HTMLParser

import html5lib
import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from rein3d_jax.report.chart import MAX_POINTS, Chart, Series, line_chart, nice_ticks
from rein3d_jax.report.colour_map import VIRIDIS, colour_map, colour_range
from rein3d_jax.report.floor_map import FloorMap, outline, render_floor_map
from rein3d_jax.report.report import Comparison, Picture, Report, Section, Table, render_report
from rein3d_jax.report.scatter import Mark, Scatter, cost_ticks, scatter_chart

JPEG, PNG = b"\xff\xd8\xff\xe0 a jpeg", b"\x89PNG\r\n\x1a\n a png"
HOSTILE = "<script>alert(1)</script> \"quoted\" & 'single'"
WHOLE = Report(
    title=f"title {HOSTILE}",
    summary=f"summary {HOSTILE}",
    facts=((f"fact {HOSTILE}", f"value {HOSTILE}"),),
    distance_origin=f"origin {HOSTILE}",
    warnings=(f"warning {HOSTILE}",),
    parts=(
        Section(f"section {HOSTILE}", f"caption {HOSTILE}", (Picture(f"picture {HOSTILE}", JPEG),), scale=(0.5, 4.0)),
        Comparison("comparison", "", Picture("coarse", JPEG), Picture("refined", PNG)),
        Comparison(
            "small", "", Picture("a", JPEG), Picture("b", PNG), (Picture(f"beside {HOSTILE}", PNG),), wide=False
        ),
    ),
    standing=Scatter(
        f"standing {HOSTILE}",
        f"stands {HOSTILE}",
        f"cost {HOSTILE}",
        "dB",
        (Mark(f"mark {HOSTILE}", 3.0, 20.0), Mark("this run", 90.0, 22.0, own=True)),
    ),
    floor_map=FloorMap(outline(np.ones(16)), outline(np.full(16, 0.6)), (np.array([[0, 0], [0.5, 0]]),), []),
    charts=(
        Chart(f"chart {HOSTILE}", f"x {HOSTILE}", "y", (Series(f"series {HOSTILE}", np.arange(3), np.arange(3)),)),
    ),
    tables=(Table(f"table {HOSTILE}", (f"column {HOSTILE}",), ((f"cell {HOSTILE}",),)),),
    sources=(f"source {HOSTILE}",),
)


class Page(HTMLParser):
    """Collects the tags with their attributes, the text, and whether every tag is closed in order."""

    def __init__(self, html):
        super().__init__()
        self.tags, self.words, self.open = [], [], []
        self.feed(html)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in ("meta", "img", "input"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.words.append(data)


@pytest.fixture(scope="module")
def page():
    return Page(render_report(WHOLE))


def test_the_page_is_well_formed_and_shows_every_text_as_text(page):
    assert page.open == []
    assert not any(tag == "script" for tag, _ in page.tags)
    text = "".join(page.words)
    names = "title summary fact value origin warning section caption picture beside standing stands cost mark chart x"
    for name in (*names.split(), "series", "table", "column", "cell", "source"):
        assert f"{name} {HOSTILE}" in text


@pytest.mark.parametrize("report", [WHOLE, Report("a room", "nothing yet")])
def test_a_parser_of_the_html_standard_finds_no_error(report):
    parser = html5lib.HTMLParser(strict=True)  # raises at the first
    parser.parse(render_report(report))
    assert not parser.errors


def test_pictures_drawings_and_dividers_have_words(page):
    assert all(attrs.get("alt") for tag, attrs in page.tags if tag == "img")
    assert all(attrs.get("aria-label") for tag, attrs in page.tags if tag in ("input", "svg"))
    assert sum(tag == "input" for tag, _ in page.tags) == 2  # one divider a comparison


def test_the_page_asks_nothing_of_the_network(page):
    links = [value for _, attrs in page.tags for name, value in attrs.items() if name in ("src", "href", "srcset")]
    assert links and all(link.startswith("data:") for link in links)
    html = render_report(WHOLE)
    assert "http:" not in html and "https:" not in html and "url(" not in html and "@import" not in html


def test_pictures_arrive_whole(page):
    pictures = [attrs["src"].split(";base64,") for tag, attrs in page.tags if tag == "img"]
    assert [base64.b64decode(code) for _, code in pictures] == [JPEG, JPEG, PNG, JPEG, PNG, PNG]
    assert all((head == "data:image/png") == (base64.b64decode(code) == PNG) for head, code in pictures)


def test_what_is_no_picture_is_refused():
    bad = dataclasses.replace(WHOLE, parts=(Section("", "", (Picture("notes", b"plain text"),)),))
    with pytest.raises(ValueError, match="'notes' is neither JPEG nor PNG"):
        render_report(bad)


def test_an_empty_report_has_no_empty_parts():
    page = Page(render_report(Report("a room", "nothing yet")))
    assert not {"section", "footer", "dl", "table", "svg"} & {tag for tag, _ in page.tags}


def circles(svg):
    tree = ElementTree.fromstring(re.match(r"<svg.*</svg>", svg).group())
    return [(float(c.get("cx")), float(c.get("cy"))) for c in tree.iter("circle")]


def test_the_floor_map_has_the_forward_axis_upwards_and_left_on_the_left():
    forward, left = np.array([[0.0, 0.0], [1.0, 0.0]]), np.array([[0.0, 0.0], [0.0, 1.0]])
    drawn = FloorMap(outline(np.full(8, 2.0)), np.zeros((0, 2)), (forward, left), [])
    ahead, beside, origin = circles(render_floor_map(drawn))
    assert ahead[1] < origin[1] and ahead[0] == origin[0]
    assert beside[0] < origin[0] and beside[1] == origin[1]
    np.testing.assert_allclose(origin[1] - ahead[1], origin[0] - beside[0], atol=0.2)  # written to a tenth of a unit


def test_a_far_view_through_a_door_does_not_shrink_the_room():
    profile = np.full(64, 2.0)
    alone = render_floor_map(FloorMap(outline(profile), outline(profile), (), []))
    profile[3] = 90.0
    with_door = render_floor_map(FloorMap(outline(profile), outline(np.full(64, 2.0)), (), []))
    np.testing.assert_allclose(circles(with_door), circles(alone), atol=20)  # one column of 64 less to hold


def test_an_outline_follows_the_columns_to_the_right():
    points = outline(np.arange(1.0, 5.0))  # azimuths -135, -45, 45, 135 degrees, turning right
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), [1, 2, 3, 4], rtol=1e-6)  # float32
    assert points[1][0] > 0 and points[1][1] > 0  # ahead, to the left
    assert points[2][0] > 0 and points[2][1] < 0  # ahead, to the right


def test_marks_stand_by_their_cost_and_merit():
    marks = (Mark("slow", 100.0, 20.0), Mark("quick", 1.0, 20.0), Mark("best", 10.0, 25.0, own=True))
    slow, quick, best = circles(scatter_chart(Scatter("t", "c", "seconds", "dB", marks)))
    assert quick[0] < best[0] < slow[0] and best[1] < quick[1] == slow[1]
    np.testing.assert_allclose(best[0] - quick[0], slow[0] - best[0], atol=0.2)  # a log scale


def test_a_run_without_truth_is_a_line_at_its_seconds():
    svg = scatter_chart(Scatter("t", "c", "s", "dB", (Mark("a", 5.0, 20.0), Mark("this run", 50.0, None, own=True))))
    assert svg.count("<circle") == 1 and "stroke-dasharray" in svg and "this run: 50<" in svg


@pytest.mark.parametrize("marks", [[], [(np.nan, 3.0)], [(0.0, 3.0)], [(1.0, np.inf)], [(7.0, None)], [(3.0, 3.0)]])
def test_any_marks_give_a_chart(marks):
    svg = scatter_chart(Scatter("t", "c", "s", "dB", tuple(Mark("a", *mark) for mark in marks)))
    assert "nan" not in svg and "inf" not in svg and ("Nothing was measured" in svg) == (marks != [(3.0, 3.0)])


@given(st.lists(st.floats(1e-3, 1e6), min_size=1, max_size=5))
@example([999999.9999999999])  # whose logarithm rounds to 6
def test_cost_ticks_hold_all_costs(costs):
    ticks = cost_ticks(costs)
    assert len(ticks) >= 2 and ticks[0] <= min(costs) and max(costs) <= ticks[-1]
    assert (np.diff(ticks) > 0).all() and len(ticks) <= 12


@given(st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_ticks_hold_the_range_and_are_few(low, span):
    ticks = nice_ticks(low, low + span)
    slack = 1e-9 * (abs(low) + span)  # float64 rounding of a multiple
    assert ticks[0] <= low + slack and ticks[-1] >= low + span - slack
    assert 3 <= len(ticks) <= 8


@pytest.mark.parametrize(
    "values", [[], [1.0], [2.0, 2.0], [np.nan, np.inf], [1.0, np.nan, 3.0], [1e-30, 0.0], [1e30, -1e30]]
)
def test_any_values_give_a_chart(values):
    svg = line_chart(Chart("loss", "step", "loss", (Series("training", np.arange(len(values)), np.array(values)),)))
    assert "nan" not in svg and "inf" not in svg
    assert ("Nothing was measured" in svg) == (not np.isfinite(values).any())


def test_a_long_curve_is_thinned_and_keeps_its_mean():
    series = Series("training", np.arange(10_000), np.linspace(0, 1, 10_000))
    svg = line_chart(Chart("loss", "step", "loss", (series,)))
    points = re.search(r'polyline points="([^"]*)"', svg).group(1).split()
    assert len(points) == MAX_POINTS
    heights = [float(point.split(",")[1]) for point in points]
    ends = [float(y) for y in re.findall(r'class="grid" d="M62 ([\d.]+)H', svg)]  # the ticks at 0 and 1
    np.testing.assert_allclose(np.mean(heights), (ends[0] + ends[-1]) / 2, atol=0.05)  # written to a tenth of a unit


def test_colours_run_from_near_to_far_and_unknown_is_grey():
    distance, valid = np.array([1.0, 3.0, 9.0, np.nan, 0.0]), np.array([True, True, True, False, False])
    rgb = colour_map(distance, valid, 1.0, 3.0)
    assert rgb.dtype == np.float32
    np.testing.assert_allclose(rgb[:3] * 255, VIRIDIS[[0, -1, -1]], atol=1e-4)  # float32
    np.testing.assert_array_equal(rgb[3:], np.full((2, 3), np.float32(0.75)))


def test_farther_is_always_lighter():
    distance = np.linspace(1, 5, 200)
    rgb = colour_map(distance, np.ones(200, bool), 1.0, 5.0)
    assert (np.diff(rgb @ [0.2126, 0.7152, 0.0722]) > 0).all()


def test_the_colour_range_leaves_outliers_and_the_unknown_out():
    distance = np.concatenate([np.linspace(1, 5, 400), [1000.0, np.nan]])
    valid = np.isfinite(distance)
    near, far = colour_range(distance, valid)
    assert 1 < near < 1.1 and 4.9 < far < 5
    assert colour_range(distance, np.zeros_like(valid)) == (0.0, 1.0)
    assert np.isfinite(colour_map(distance, valid, 2.0, 2.0)).all()  # one distance only
