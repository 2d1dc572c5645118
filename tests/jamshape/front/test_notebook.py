"""The notebook runs from its first cell to its last, and shows a picture where it should."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")

NOTEBOOK = Path(__file__).parents[3] / "docs" / "course" / "first_packing.ipynb"


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("notebook")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    resources = {"metadata": {"path": str(folder)}}
    return nbclient.NotebookClient(notebook, timeout=300, resources=resources).execute()


def outputs(notebook, text):
    [cell] = [c for c in notebook.cells if c.cell_type == "code" and c.source.endswith(text)]
    return cell.outputs


@pytest.mark.lammps
@pytest.mark.parametrize("last_line", ["\nrun", "\npacking", "\nmodes"])
def test_results_show_themselves_with_a_picture(executed, last_line):
    shown = [o.data["text/html"] for o in outputs(executed, last_line) if "data" in o]
    assert len(shown) == 1
    assert "data:image/png;base64," in shown[0]
    assert "&lt;" in shown[0]


@pytest.mark.lammps
def test_a_run_shows_how_far_it_is(executed):
    bars = [o.text for o in outputs(executed, "\nrun") if o.output_type == "stream"]
    assert "phi 0.9000" in "".join(bars)


@pytest.mark.lammps
def test_a_plot_is_a_figure_and_nothing_more(executed):
    [shown] = outputs(executed, 'js.plot(packing, color="orientation");')
    assert "image/png" in shown.data


def test_no_output_is_committed():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
