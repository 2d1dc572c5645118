"""The pages of the styles: built as LAMMPS's own are, with examples that run and every column that there is."""

import re

import pytest
from lammps_runs import REPOSITORY, before_box, load_plugin, run_lmp_well
from lammps_scenes import dense

from jamshape.files.lammps_text import write_data
from jamshape.flow.motion import Motion
from jamshape.flow.shear import Shear
from jamshape.shapes.table import SHAPES

PAGES = REPOSITORY / "docs" / "reference"
STYLES = [page.stem for kind in ("pair", "fix", "compute") for page in PAGES.glob(f"{kind}_*.md")]
SECTIONS = ["Syntax", "Examples", "Description", "Restrictions", "Related", "Default"]


def text_of(name):
    return (PAGES / f"{name}.md").read_text(encoding="utf-8")


def part_of(name, title):
    return re.search(rf"^## {title}\n(.*?)(?=^## |\Z)", text_of(name), re.MULTILINE | re.DOTALL)[1]


def examples():
    for name in STYLES:
        block = part_of(name, "Examples").split("```")[1]
        for text in block.strip().split("\n\n"):
            yield pytest.param(name, text, id=f"{name}-{text.splitlines()[0]}")


@pytest.mark.parametrize("name", [*STYLES, "create_random"])
def test_a_page_has_the_sections_of_lammps(name):
    titles = re.findall(r"^## (.*)", text_of(name), re.MULTILINE)
    assert [title for title in titles if title in SECTIONS] == SECTIONS


def test_every_style_that_is_registered_has_a_page():
    register = (REPOSITORY / "lammps_plugin" / "styles" / "register.cpp").read_text()
    registered = re.findall(r'add\("([\w/]+)"', register) + [f"{name}/harmonic" for name in SHAPES]
    pages = {re.sub(r"^(pair|fix|compute)_", "", name).replace("_", "/") for name in STYLES}
    assert set(registered) - {"create_random"} == pages


@pytest.mark.lammps
@pytest.mark.parametrize(("name", "text"), list(examples()))
def test_examples_run(name, text, tmp_path):
    """In a scene to which what an example leaves open is added."""
    write_data(tmp_path / "rods.data", dense(n=16))
    lines = text.splitlines()
    pair = "" if name.startswith("pair") else "pair_style spherocylinder/harmonic sides two\npair_coeff * * 1"  # fmt: skip
    fix = "" if name.startswith("fix") else "fix flow all overdamped/affine drag 1 compress 1e-4"
    run_lmp_well(
        "\n".join(
            [before_box(2), load_plugin(), "read_data rods.data", pair, *lines, fix, "run 2"]
        ),
        tmp_path,
    )


@pytest.mark.lammps
@pytest.mark.parametrize(
    "text", part_of("create_random", "Examples").split("```")[1].strip().splitlines()
)
def test_examples_of_the_command_run(text, tmp_path):
    dimension = 2 if text.split()[1] in {"spherocylinder", "spheropolygon"} else 3
    said = run_lmp_well(f"{before_box(dimension)}\n{load_plugin()}\n{text}", tmp_path)
    assert "Created 64 particles at random" in said


@pytest.mark.parametrize(
    ("name", "members"),
    [
        ("compute_packing", Motion.of_packing | Shear.of_packing),
        ("fix_overdamped_affine", Motion.of_fix | Shear.of_fix),
    ],
)
def test_pages_number_all_elements(name, members):
    rows = re.findall(r"^\| ([\d, to]+) \|", text_of(name), re.MULTILINE)
    numbers = [int(number) for row in rows for number in _spread(row)]
    assert numbers == list(range(1, numbers[-1] + 1))
    assert max(members.values()) < numbers[-1]


def _spread(row):
    if "to" in row:
        first, last = map(int, row.split("to"))
        return range(first, last + 1)
    return row.split(",")
