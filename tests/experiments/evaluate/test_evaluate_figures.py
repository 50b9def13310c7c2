"""Figures of one room by hand; the Pareto front by its law; the chart from results."""

import json
from dataclasses import asdict
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from experiments.evaluate import __main__ as evaluate
from experiments.evaluate.chart import chart_points, spread_labels
from experiments.evaluate.measure import BEST_PSNR, distance_figures, picture_figures, sphere_figures
from experiments.evaluate.pareto import pareto_front
from rein3d_jax.io.weights.metric_weights import lpips_weights

ROOT = Path(__file__).resolve().parents[3]
METRES = np.array([0.2, 0.7, 2.5])


@pytest.fixture(scope="module")
def truth():
    return jnp.asarray(np.random.default_rng(0).uniform(0.2, 0.8, (3, 32, 64, 3)), jnp.float32)


@pytest.fixture(scope="module")
def masks():
    hole = np.zeros((3, 32, 64), bool)
    hole[1:, 8:16, 10:30] = True
    return {"hole": jnp.asarray(hole), "observed": jnp.asarray(~hole), "never_seen": jnp.zeros((3, 32, 64), bool)}


def test_a_perfect_method_has_the_best_values(truth, masks):
    figures = picture_figures(truth, truth, masks, METRES, lpips_weights())
    figures |= sphere_figures(truth, truth, masks, METRES)
    for name in ("psnr", "psnr_hole", "psnr_at_2-3m", "ws_psnr", "ws_psnr_observed"):
        assert figures[name] == BEST_PSNR
    for name in ("ssim", "ssim_hole", "ws_ssim", "ws_ssim_hole"):
        assert figures[name] == pytest.approx(1, abs=1e-5)  # float32 sums
    assert figures["lpips"] == pytest.approx(0, abs=1e-6) and figures["seam"] == figures["seam_truth"]
    assert np.isnan(figures["psnr_never_seen"]) and np.isnan(figures["psnr_at_3m+"])
    distance = jnp.full((3, 32, 64), 2.0)
    figures = distance_figures(distance, distance, masks, METRES)
    assert figures["abs_rel"] == figures["abs_rel_hole"] == 0 and figures["delta_1.25"] == 1


def test_splits_by_hand(truth, masks):
    """An error of 0.1 within the hole alone is 20 dB there, and less over a whole picture by its share."""
    shown = truth + 0.1 * masks["hole"][..., None]
    figures = picture_figures(shown, truth, masks, METRES, lpips_weights())
    assert figures["psnr_hole"] == pytest.approx(20, abs=1e-3)  # float32
    assert figures["psnr_observed"] == figures["psnr_at_0-0.5m"] == BEST_PSNR
    share = 8 * 20 / (32 * 64)
    assert figures["psnr_at_0.5-1m"] == pytest.approx(20 - 10 * np.log10(share), abs=1e-3)
    assert figures["psnr"] == pytest.approx((100 + 2 * (20 - 10 * np.log10(share))) / 3, abs=1e-3)
    assert figures["share_hole"] == pytest.approx(share * 2 / 3, rel=1e-6)
    assert figures["ssim_hole"] < figures["ssim_observed"]
    distance = jnp.full((3, 32, 64), 2.0)
    figures = distance_figures(jnp.where(masks["hole"], 3.0, 2.0), distance, masks, METRES)
    assert figures["abs_rel_hole"] == pytest.approx(0.5) and figures["abs_rel_observed"] == 0
    assert figures["delta_1.25_hole"] == 0 and figures["delta_1.25_observed"] == 1


def test_the_front_is_what_none_beats():
    """Nobody on it is beaten; whoever is not on it is beaten by one who is; along it cost and merit rise together."""
    draw = np.random.default_rng(1)
    for _ in range(200):
        points = [tuple(point) for point in draw.integers(0, 6, (draw.integers(1, 12), 2))]
        front = pareto_front(points)

        def beats(a, b):
            return a != b and a[0] <= b[0] and a[1] >= b[1]

        for i, point in enumerate(points):
            assert (i in front) == (not any(beats(points[j], point) for j in front))
            assert i not in front or not any(beats(other, point) for other in points)
        along = [points[i] for i in front]
        assert along == sorted(along) and [y for _, y in along] == sorted(y for _, y in along)
    assert pareto_front([]) == []


def test_labels_keep_apart():
    placed = spread_labels([0.1, 0.11, 0.5, 0.99, 1.0], apart=0.1)
    assert min(np.diff(placed)) >= 0.1 - 1e-9 and max(placed) <= 1


def result(file, rooms=("a", "b"), recipe="quick", psnr=20.0, seconds=2.0):
    def row(mean):
        return {"mean": mean, "sem": 0.5, "rooms": dict.fromkeys(rooms, mean)}

    methods = {"coarse": {"psnr": row(psnr), "seconds": row(seconds), "gaussians": row(1000.0)},
               "worse": {"psnr": row(psnr - 1), "seconds": row(seconds + 1), "triangles": row(10.0)}}  # fmt: skip
    file.write_text(json.dumps({"recipe": recipe, "rooms": list(rooms), "novel_views": methods}))
    return str(file)


def test_chart(tmp_path):
    pytest.importorskip("matplotlib", reason="of the bench extra")
    files = [result(tmp_path / "one.json"), result(tmp_path / "two.json", recipe="paper", psnr=25.0, seconds=60.0)]
    points = tmp_path / "points.json"
    assert evaluate.main(["--chart", *files, "--points", str(points)]) == 0
    assert (tmp_path / "one.png").read_bytes().startswith(b"\x89PNG")
    table = json.loads(points.read_text())
    by_seconds, by_gaussians = table["panels"]  # the others have no figures
    on_front = {point["label"] for point in by_seconds["points"] if point["on_front"]}
    assert len(by_seconds["points"]) == 4 and on_front == {"coarse (quick)", "coarse (paper)"}
    assert {point["label"] for point in by_gaussians["points"]} == on_front and table["rooms"] == ["a", "b"]


def test_a_chart_that_cannot_be_drawn_is_refused_before_anything_is_measured(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    asked = ["--rooms", str(tmp_path / "missing"), "--json", str(tmp_path / "out.json"), "--chart"]
    assert evaluate.main(asked) == 2 and "matplotlib" in capsys.readouterr().err


def test_a_chart_compares_the_same_rooms(tmp_path, capsys):
    files = [result(tmp_path / "one.json"), result(tmp_path / "two.json", rooms=("a",))]
    assert evaluate.main(["--chart", *files]) == 2 and "different rooms" in capsys.readouterr().err
    (tmp_path / "no.json").write_text("[]")
    assert evaluate.main(["--chart", str(tmp_path / "no.json")]) == 2 and "no result" in capsys.readouterr().err


def test_what_the_report_compares_with_is_the_committed_results():
    """After new ones, in benchmarks/results: python -m experiments.evaluate
    --chart evaluate.json evaluate_draft.json evaluate_quick.json
    --points ../../experiments/reconstruct/pages/measured.json
    """
    results = ROOT / "benchmarks" / "results"
    rooms, panels = chart_points([results / f"evaluate{name}.json" for name in ("", "_draft", "_quick")])
    packaged = json.loads((ROOT / "experiments/reconstruct/pages/measured.json").read_text())
    table = [asdict(panel) | {"points": [asdict(point) for point in points]} for panel, points in panels]
    assert packaged == {"rooms": rooms, "panels": table}
