"""The notebook runs from its first cell to its last, and shows pictures."""

from pathlib import Path

import pytest

import experiments

pytestmark = pytest.mark.slow  # the whole notebook

nbformat = pytest.importorskip("nbformat", reason="pip install nbclient ipykernel")
nbclient = pytest.importorskip("nbclient", reason="pip install nbclient ipykernel")
pytest.importorskip("ipykernel", reason="pip install nbclient ipykernel")

TOUR = Path(experiments.__file__).parent / "tour.ipynb"
SHOWN = {"image/jpeg", "text/html"}


def test_the_tour_runs_and_shows_pictures(tmp_path):
    notebook = nbformat.read(TOUR, as_version=4)
    nbformat.validate(notebook)
    client = nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": str(tmp_path)}})
    client.execute()  # raises what a cell raises
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    assert not [output for output in outputs if output.output_type == "stream" and output.name == "stderr"]
    assert sum(bool(SHOWN & output.get("data", {}).keys()) for output in outputs) == 6
