"""The recipes of docs/how-to/other-tools.md, word for word."""

import re
from pathlib import Path

import pytest
from scenes import pressed, scaled
from written import write_content

from jamshape.contacts import find_contacts
from jamshape.files.h5md import write_packing

PAGE = Path(__file__).parents[3] / "docs/how-to/other-tools.md"
TEXT = PAGE.read_text(encoding="utf-8")

# A section is named by its tool; what must be importable for it.
NEEDS = {
    "GSD": "gsd",
    "freud": "freud",
    "OVITO": "ovito",
    "MDAnalysis": "MDAnalysis",
    "Arrays": "numpy",
}

RECIPES = [
    pytest.param(tool, code, id=f"{tool}-{k}")
    for tool in NEEDS
    for section in re.findall(rf"^## {tool}\n(.*?)(?=^## |\Z)", TEXT, re.DOTALL | re.MULTILINE)
    for k, code in enumerate(re.findall(r"```python\n(.*?)```", section, re.DOTALL))
]


@pytest.fixture(params=[2, 3])
def folder(request, tmp_path, monkeypatch):
    """A working directory with a packing and a run of three frames."""
    first = pressed(dimension=request.param)
    assert len(find_contacts(first).pairs)
    write_packing(tmp_path / "packing.h5", first)
    told = {"kind": "compression", "finished": True, "kappa": 1e-6}
    later = [scaled(first, 1 - 0.01 * k).with_(step=k, time=float(k)) for k in (1, 2)]
    row = (first.step, first.time, {"phi": first.phi, "pressure": 0.1})
    write_content(tmp_path / "run.h5", [first, *later], told, [row])
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_recipe_is_tried():
    assert len(RECIPES) == TEXT.count("```python") == 8
    assert {param.values[0] for param in RECIPES} == set(NEEDS)


@pytest.mark.parametrize(("tool", "code"), RECIPES)
@pytest.mark.filterwarnings("ignore::DeprecationWarning:MDAnalysis")
def test_recipe_runs(folder, tool, code):
    pytest.importorskip(NEEDS[tool])
    try:
        exec(compile(code, str(PAGE), "exec"), {})  # noqa: S102 - our own page
    except RuntimeError as error:
        if "Vulkan" not in str(error):
            raise
        pytest.skip("this OVITO draws nothing without libvulkan1 and mesa-vulkan-drivers")
    made = {path.name for path in folder.iterdir()} - {"packing.h5", "run.h5"}
    assert made == set(re.findall(r'"((?:packing|run)\.(?:gsd|png|h5md)|mine\.h5)"', code))
