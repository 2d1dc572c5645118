"""Every link of a page leads somewhere, and every file that a page names is there."""

import re
from pathlib import Path

import pytest

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
