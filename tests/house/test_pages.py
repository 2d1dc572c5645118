"""Every link of a page leads somewhere, and every file that a page names is there."""

import csv
import re
import tomllib
from pathlib import Path

import pytest

import jamshape
from jamshape.flow.cyclic_shear import CyclicShear
from jamshape.flow.quasistatic import Row
from jamshape.vibration.table import BANDS, COLUMNS

ROOT = Path(__file__).parents[2]
FOLDERS = ("docs", "analysis", "inputs", "lammps_plugin", "pyscripts", "tests")

LINK = re.compile(r"\]\(([^)\s]+)\)")
FILE = re.compile(
    rf"(?<![\w/.-])(?:{'|'.join(FOLDERS)})/[\w./-]*\.(?:py|pyi|smk|in|lmp|md|hpp|h|cpp|png)\b"
)
FOLDER = re.compile(rf"`((?:{'|'.join(FOLDERS)})/[\w/-]*/)`")


def pages():
    found = [
        *ROOT.glob("*.md"),
        *(page for name in FOLDERS for page in (ROOT / name).rglob("*.md")),
    ]
    return sorted(page.relative_to(ROOT).as_posix() for page in found)


@pytest.fixture(params=pages())
def page(request):
    return ROOT / request.param


def test_links_lead_to_files(page):
    targets = [link.split("#")[0] for link in LINK.findall(page.read_text(encoding="utf-8"))]
    relative = [target for target in targets if target and "://" not in target]
    assert [target for target in relative if not (page.parent / target).exists()] == []


def test_files_that_are_named_are_there(page):
    text = page.read_text(encoding="utf-8")
    named = {*FILE.findall(text), *FOLDER.findall(text)}
    assert sorted(name for name in named if not (ROOT / name).exists()) == []


ARCHITECTURE = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
SOURCES = (
    "pyscripts/**/*.py",
    "lammps_plugin/**/*.hpp",
    "lammps_plugin/**/*.h",
    "lammps_plugin/**/*.cpp",
)


def test_layers_of_the_page_are_those_that_are_checked():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    [contract] = [c for c in settings["tool"]["importlinter"]["contracts"] if c["type"] == "layers"]
    checked = [layer.replace(" | ", ", ") for layer in reversed(contract["layers"])]
    [block] = [b for b in ARCHITECTURE.split("```") if b.strip().startswith("checks")]
    assert [layer.strip() for layer in block.split("<-")] == checked


def test_names_on_the_way_of_a_particle_are_in_the_code():
    walk = ARCHITECTURE.split("## One particle")[1].split("\n## ")[0]
    spans = " ".join(re.findall(r"`([^`]+)`", walk))
    names = set(re.findall(r"[A-Za-z_]\w{2,}", re.sub(r'"[^"]*"', "", spans)))
    code = " ".join(p.read_text(encoding="utf-8") for glob in SOURCES for p in ROOT.glob(glob))
    assert names - set(re.findall(r"\w+", code)) == set()


REFERENCE = ROOT / "docs" / "reference"


def test_every_public_name_has_an_entry_in_the_reference():
    text = (REFERENCE / "python.md").read_text(encoding="utf-8")
    entries = set(re.findall(r"auto(?:class|function):: jamshape\.(\w+)$", text, re.MULTILINE))
    assert set(jamshape.__all__) - entries == set()


def table_columns():
    """List the columns of the CSV tables of results, `G at 0.01` as `G`."""
    for path in (ROOT / "docs" / "results" / "tables").rglob("*.csv"):
        with path.open(newline="", encoding="utf-8") as file:
            yield from (column.split(" at ")[0] for column in next(csv.reader(file)))


def test_every_column_is_defined():
    pages = (REFERENCE / "columns.md", ROOT / "docs" / "explanation" / "files.md")
    defined = set(
        re.findall(r"`([\w()]+)`", "".join(page.read_text(encoding="utf-8") for page in pages))
    )
    runs = {*CyclicShear.of_packing, *CyclicShear.of_fix, *Row._fields}
    assert {*runs, *table_columns()} - {"step", *BANDS.values()} - defined == set()
    assert set(COLUMNS) - defined == set()
    assert all(f"{code}: " in pages[0].read_text(encoding="utf-8") for code in BANDS)
