"""Tables of the pages about the papers are lines of agreement.md, and those are in docs/results/tables."""

import csv
import math
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
RESULTS = ROOT / "docs" / "results"
PAPERS = {
    "marschall-2018": 10, "yuan-2019": 10, "vanderwerf-2018": 1,
    "zhang-2021": 7, "marschall-shear": 5, "brito-2018": 6, "rocks-hoy-2023": 1,
    "heussinger-2020": 5,
}  # fmt: skip
"""With more measured numbers than that."""


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(ROOT / "analysis" / "agreement.py"))


def rows(paper):
    with (RESULTS / "tables" / paper / "agreement.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def line_of(script, row):
    """Write a row as agreement.py does."""
    number = {k: float(row[k] or "nan") for k in ("paper", "paper_error", "ours", "our_error", "difference")}  # fmt: skip
    published = script["Published"](
        row["quantity"], row["where"], number["paper"], number["paper_error"], "", "", row["remark"]
    )
    at_rest = row.get("reached_samples")
    reached = float(row.get("ours_reached") or "nan"), int(at_rest) if at_rest else None
    samples = int(row["samples"] or 0)
    ours = script["Ours"](number["ours"], number["our_error"], samples, *reached)
    ours = None if math.isnan(ours.value) else ours
    told = script["Row"](published, ours, number["difference"], row["verdict"])
    return f"| {' | '.join(script['cells'](told))} |"


@pytest.mark.parametrize("paper", PAPERS)
def test_every_number_that_was_measured_stands_on_the_page(script, paper):
    page = (RESULTS / f"{paper}.md").read_text(encoding="utf-8").splitlines()
    measured = [row for row in rows(paper) if row["verdict"] != script["UNMEASURED"]]
    assert len(measured) > PAPERS[paper]
    assert [line for row in measured if (line := line_of(script, row)) not in page] == []


@pytest.mark.parametrize("paper", PAPERS)
def test_every_number_of_the_paper_is_in_the_table(script, paper):
    asked = script["read_paper"](ROOT / "analysis" / paper.replace("-", "_") / "paper.csv")
    told = [(row["quantity"], float(row["paper"]), row["remark"]) for row in rows(paper)]
    assert told == [(one.quantity, one.value, one.remark) for one in asked]
