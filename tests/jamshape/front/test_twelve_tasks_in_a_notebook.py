"""The page of twelve tasks as its reader would paste it into a notebook; tests/house/test_code_blocks.py runs it as a script."""

import pytest
from code_blocks import blocks_of
from PIL import Image

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("freud")

PAGE = "docs/how-to/twelve-tasks.md"
SHOWN = {"4": 1, "6": 1, "8": 1, "11": 1}
"""Figures that appear below the cells of a task."""

pytestmark = [pytest.mark.lammps, pytest.mark.validate]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("notebook")


@pytest.fixture(scope="module")
def cells(folder):
    blocks = [block for block in blocks_of(PAGE) if block.language == "python"]
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(b.text) for b in blocks])
    resources = {"metadata": {"path": str(folder)}}
    nbclient.NotebookClient(notebook, timeout=300, resources=resources).execute()
    return {
        b.section.partition(".")[0]: c.outputs for b, c in zip(blocks, notebook.cells, strict=True)
    }


def test_every_task_is_there_and_none_warns(cells):
    assert list(cells)[1:] == [str(k) for k in range(1, 13)]
    warned = {name: o.text for name, out in cells.items() for o in out if o.get("name") == "stderr"}
    assert not warned


def test_figures_appear_below_their_cells(cells):
    found = {
        name: sum("image/png" in o.get("data", {}) for o in out) for name, out in cells.items()
    }
    assert {name: n for name, n in found.items() if n} == SHOWN


def test_numbers_are_printed_and_finite(cells):
    said = {name: "".join(o.get("text", "") for o in out) for name, out in cells.items()}
    assert {name for name, text in said.items() if text} >= {*"123458", "9", "10", "12"}
    assert not any("nan" in text.split() for text in said.values())


@pytest.mark.parametrize("name", ["histogram.png", "rdf.png", "cycles.png", "participation.png", "softest.gif"])  # fmt: skip
def test_pictures_are_not_blank(cells, folder, name):
    del cells
    with Image.open(folder / name) as image:
        assert min(image.size) > 200
        assert len(image.convert("RGB").getcolors(2**24)) > 20
