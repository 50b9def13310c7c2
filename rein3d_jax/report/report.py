"""A run's report for someone who has never seen the code: one HTML page that asks nothing of the network.

Pure: the pictures come in encoded, the page goes out as text. All text is escaped; a policy in the page forbids
every request."""

import base64
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from html import escape
from typing import Any

from rein3d_jax.report.chart import Chart, line_chart
from rein3d_jax.report.colour_map import VIRIDIS
from rein3d_jax.report.floor_map import FloorMap, render_floor_map
from rein3d_jax.report.scatter import Scatter, scatter_chart
from rein3d_jax.report.style import STYLE

_SIGNATURES = {b"\xff\xd8\xff": "image/jpeg", b"\x89PNG": "image/png"}
_POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'unsafe-inline'"


@dataclass(frozen=True)
class Picture:
    """The bytes of a JPEG or PNG file, and what it shows."""

    label: str
    data: bytes


@dataclass(frozen=True)
class Section:
    """Pictures side by side, as many as fit; `scale` (near, far) in metres explains a distance's colours."""

    heading: str
    caption: str
    pictures: tuple[Picture, ...]
    scale: tuple[float, float] | None = None
    wide: bool = False  # panoramas: at most two beside each other


@dataclass(frozen=True)
class Comparison:
    """Two pictures of one size, one over the other, with a divider to drag; others may stand beside them."""

    heading: str
    caption: str
    before: Picture
    after: Picture
    beside: tuple[Picture, ...] = ()
    wide: bool = True  # as a Section's


@dataclass(frozen=True)
class Table:
    """Rows of text under one heading each column; the first column names the row."""

    heading: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Report:
    """Contents of the page, in the order it is read. Parts left empty are left out."""

    title: str
    summary: str
    facts: tuple[tuple[str, str], ...] = ()  # (name, value), the numbers to see first
    distance_origin: str = ""  # "given" or what estimated it, with what that means
    warnings: tuple[str, ...] = ()
    parts: tuple[Section | Comparison, ...] = ()
    standing: Scatter | None = None  # this run among what was measured before
    floor_map: FloorMap | None = None
    charts: tuple[Chart, ...] = ()
    tables: tuple[Table, ...] = ()
    sources: tuple[str, ...] = ()  # whose pictures, under which licence


def render_report(report: Report) -> str:
    """HTML of the whole page. Raises ValueError as picture_uri does."""
    title = escape(report.title)
    return (
        f'<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{_POLICY}">'
        f'<meta name="viewport" content="width=device-width,initial-scale=1"><style>{STYLE}</style></head>'
        f"<body><main><h1>{title}</h1><p>{escape(report.summary)}</p>{_facts(report)}{_warnings(report.warnings)}"
        f"{_each(_part, report.parts)}{_standing(report.standing)}{_floor_map(report.floor_map)}"
        f"{_charts(report.charts)}{_each(_table, report.tables)}{_sources(report.sources)}</main></body></html>\n"
    )


def picture_uri(picture: Picture) -> str:
    """The picture as a data: address. Raises ValueError where it is neither JPEG nor PNG."""
    media = next((name for start, name in _SIGNATURES.items() if picture.data.startswith(start)), None)
    if media is None:
        raise ValueError(f"the picture {picture.label!r} is neither JPEG nor PNG")
    return f"data:{media};base64,{base64.b64encode(picture.data).decode()}"


def _each(render: Callable[[Any], str], things: Iterable) -> str:
    return "".join(map(render, things))


def _facts(report: Report) -> str:
    cards = _each(lambda fact: f"<div><dt>{escape(fact[0])}</dt><dd>{escape(fact[1])}</dd></div>", report.facts)
    origin = f"<p>Distance: {escape(report.distance_origin)}</p>" if report.distance_origin else ""
    return origin + (f'<dl class="facts">{cards}</dl>' if cards else "")


def _warnings(warnings: tuple[str, ...]) -> str:
    items = _each(lambda warning: f"<li>{escape(warning)}</li>", warnings)
    return f'<div class="warnings"><strong>Good to know</strong><ul>{items}</ul></div>' if items else ""


def _part(part: Section | Comparison) -> str:
    body = _slider(part) if isinstance(part, Comparison) else _pictures(part)
    return f'<section><h2>{escape(part.heading)}</h2><p class="quiet">{escape(part.caption)}</p>{body}</section>'


def _pictures(section: Section) -> str:
    scale = _scale(*section.scale) if section.scale else ""
    return f'<div class="row{" wide" * section.wide}">{_each(_figure, section.pictures)}</div>{scale}'


def _figure(picture: Picture) -> str:
    return f"<figure>{_image(picture)}<figcaption>{escape(picture.label)}</figcaption></figure>"


def _scale(near: float, far: float) -> str:
    stops = ",".join(f"rgb({r},{g},{b})" for r, g, b in VIRIDIS)
    bar = f'<i style="background:linear-gradient(90deg,{stops})"></i>'
    return f'<div class="scale"><span>{near:.1f} m</span>{bar}<span>{far:.1f} m; grey: unknown</span></div>'


def _slider(comparison: Comparison) -> str:
    move = "this.parentNode.style.setProperty('--x',this.value+'%')"
    before, after = comparison.before, comparison.after
    slider = (
        f'<div class="slider">{_image(before)}{_image(after, "after")}'
        f'<span class="left">{escape(before.label)}</span><span class="right">{escape(after.label)}</span>'
        f'<input type="range" min="0" max="100" step="0.1" value="50" aria-label="Divider" oninput="{move}"></div>'
    )
    if comparison.wide and not comparison.beside:
        return slider
    return f'<div class="row{" wide" * comparison.wide}">{slider}{_each(_figure, comparison.beside)}</div>'


def _image(picture: Picture, kind: str = "") -> str:
    style = f' class="{kind}"' if kind else ""
    return f'<img{style} alt="{escape(picture.label)}" src="{picture_uri(picture)}">'


def _floor_map(floor_map: FloorMap | None) -> str:
    if floor_map is None:
        return ""
    caption = '<p class="quiet">Seen from the ceiling. One square of the grid is one metre.</p>'
    return f"<section><h2>Where the camera went</h2>{caption}{render_floor_map(floor_map)}</section>"


def _standing(scatter: Scatter | None) -> str:
    if scatter is None:
        return ""
    chart = f'<figure class="standing">{scatter_chart(scatter)}</figure>'
    caption = f'<p class="quiet">{escape(scatter.caption)}</p>'
    return f"<section><h2>{escape(scatter.title)}</h2>{caption}{chart}</section>"


def _charts(charts: tuple[Chart, ...]) -> str:
    figures = _each(lambda chart: f"<figure><h3>{escape(chart.title)}</h3>{line_chart(chart)}</figure>", charts)
    return f'<section><h2>How it learned</h2><div class="row wide">{figures}</div></section>' if figures else ""


def _table(table: Table) -> str:
    head = _each(lambda name: f"<th>{escape(name)}</th>", table.columns)
    rows = _each(lambda row: f"<tr>{_each(lambda cell: f'<td>{escape(cell)}</td>', row)}</tr>", table.rows)
    body = f"<table><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
    return f'<section><h2>{escape(table.heading)}</h2><div class="table">{body}</div></section>'


def _sources(sources: tuple[str, ...]) -> str:
    items = _each(lambda source: f"<p>{escape(source)}</p>", sources)
    return f"<footer><h2>Sources and licences</h2>{items}</footer>" if items else ""
