"""Growth is the exponent of a power law; what jobs cannot be asked is refused by name."""

import pytest

from benchmarks.time import growth
from experiments.command_list import run_listed


def test_growth_is_the_exponent():
    laws = {"cpu_s": 1.5, "peak_bytes": 0.5, "viewer_bytes": 0.0, "gaussians": 0.75}
    by_rows = {rows: {of: 7.0 * (2 * rows**2) ** law for of, law in laws.items()} for rows in (128, 256, 1024)}
    found = growth(by_rows)
    for of, law in laws.items():
        assert found[f"{of} / pixels"] == pytest.approx(law, abs=1e-3)  # it is rounded
        assert of == "gaussians" or found[f"{of} / gaussians"] == pytest.approx(law / laws["gaussians"], abs=1e-3)


@pytest.mark.parametrize("wrong", [["time", "--rounds", "0"], ["killed", "--count", "0"]])
def test_no_job_is_refused(wrong, capsys):
    name, option, _ = wrong
    assert run_listed("benchmarks", wrong) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"{name}: {option} 0 ") and error.count("\n") == 1
