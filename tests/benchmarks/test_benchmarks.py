"""Workloads are what they say, the baseline draws the right picture, every benchmark is listed and refuses by name."""

from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from benchmarks.engines import prototype as engine_prototype
from benchmarks.engines.ours import CONFIG, camera_of, scene_of
from benchmarks.poles import footprint_errors
from benchmarks.workloads import ROOM, SIZES, Size, make_workload
from experiments.command_list import commands, run_listed
from rein3d_jax.rasterize.reference import rasterize_reference

ROOT = Path(__file__).resolve().parents[2]
# What benchmarks are made of.
PARTS = {
    "__init__",
    "__main__",
    "workloads",
    "studies.__init__",
    "studies.box_room",
    "studies.room_table",
    "studies.charts.__init__",
    "studies.charts.compact",
    "studies.charts.parsimony",
    "convert.__init__",
    "convert.array_pickle",
    "convert.checkpoint",
}
SMALL = Size(40, 0.3, 24, 16)


def test_workload_is_a_room_of_the_stated_splats():
    workload = make_workload(SIZES["C"])
    assert np.all(np.abs(workload.means) < ROOM / 2 + 0.03)  # 4 mm of jitter
    on_shell = np.any(np.abs(np.abs(workload.means) - ROOM / 2) < 0.02, axis=1)
    assert 0.6 < on_shell.mean() < 0.98
    scales = np.log(workload.scales)
    assert abs(np.median(scales) - np.log(0.04)) < 0.01 and abs(scales.mean(1).std() - 0.404) < 0.02
    assert workload.opacities.min() >= 0.3 and workload.opacities.max() <= 0.95
    seen = np.abs(workload.means[:, 0]) * workload.focal < 128 * workload.means[:, 2]
    seen &= np.abs(workload.means[:, 1]) * workload.focal < 128 * workload.means[:, 2]
    assert abs(seen.sum() - 2800) < 500  # of 20,000: the camera sees 70 degrees of the room


def test_prototype_equals_the_dense_oracle():
    workload = make_workload(SMALL)
    scene, camera, target = scene_of(workload), camera_of(workload), jnp.asarray(workload.target)
    engine = engine_prototype.build(workload)

    def loss(opacity_logits, means):
        image = rasterize_reference(scene.replace(opacity_logits=opacity_logits, means=means), camera, config=CONFIG)[0]
        return jnp.mean((image - target) ** 2)

    value, (of_opacity, of_means) = jax.value_and_grad(loss, argnums=(0, 1))(scene.opacity_logits, scene.means)
    actual, gradient = engine.gradient()
    np.testing.assert_allclose(actual, value, rtol=1e-5)  # float32 sums over 1152 numbers
    for got, expected in ((gradient["opacity_logits"], of_opacity), (gradient["means"], of_means)):
        np.testing.assert_allclose(got, expected, atol=1e-4 * float(jnp.abs(expected).max()))


@pytest.mark.parametrize("latitude", [0.0, 89.9])
def test_footprint_is_the_samples_at_a_third_of_a_radian(latitude):
    """Within 5 % of the second moments, at the poles and at the largest splat that is measured."""
    assert footprint_errors(latitude, 0.3)["ours"] < 0.05


@pytest.mark.parametrize("wrong", [["--engines", "warp"], ["--workloads", "Z"], ["--rounds", "0"]])
def test_bad_arguments_are_refused_by_name(wrong, capsys):
    assert run_listed("benchmarks", ["rasterize", *wrong]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and wrong[0] in error


def test_every_benchmark_is_listed_and_tells_its_arguments(capsys):
    listed = commands(ROOT / "benchmarks")
    paths = [path.relative_to(ROOT / "benchmarks").with_suffix("") for path in (ROOT / "benchmarks").rglob("*.py")]
    modules = {".".join(path.parts) for path in paths if path.parts[0] not in ("engines", "stability")} | {"stability"}
    assert listed.keys() == modules - PARTS
    assert all(line.endswith(".") for line in listed.values())
    for name in listed.keys() - {"studies.choice_chart", "viewer_shot"}:  # these need matplotlib and playwright
        with pytest.raises(SystemExit, match="0"):
            run_listed("benchmarks", [name, "--help"])
        assert f"benchmarks.{name}" in capsys.readouterr().out
