"""Tables of the pages about the papers are those of docs/results/tables, number by number."""

import csv
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
PAPERS = ("marschall-2018", "yuan-2019")
UNMEASURED = "not measured at this scale"


def rows(paper):
    with (RESULTS / "tables" / paper / "agreement.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def line_of(row):
    """Write a row as it stands on the page."""
    number = runpy.run_path(str(ROOT / "analysis" / "agreement.py"))["number"]

    def written(value, error):
        return number(float(row[value]), float(row[error] or "nan"))

    off = f"{float(row['difference']):+.1f}" if row["difference"] else ""
    cells = (row["quantity"], row["where"], written("paper", "paper_error"), written("ours", "our_error"))  # fmt: skip
    return f"| {' | '.join((*cells, row['samples'], off, row['verdict']))} |"


@pytest.mark.parametrize("paper", PAPERS)
def test_every_number_that_was_measured_stands_on_the_page(paper):
    page = (RESULTS / f"{paper}.md").read_text(encoding="utf-8")
    measured = [line_of(row) for row in rows(paper) if row["verdict"] != UNMEASURED]
    assert len(measured) > 10
    assert [line for line in measured if line not in page] == []


@pytest.mark.parametrize("paper", PAPERS)
def test_every_number_of_the_paper_is_in_the_table(paper):
    name = paper.replace("-", "_")
    with (ROOT / "analysis" / name / "paper.csv").open(newline="") as file:
        asked = [row["quantity"] for row in csv.DictReader(file)]
    assert [row["quantity"] for row in rows(paper)] == asked
