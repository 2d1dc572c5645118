"""Numbers on the pages of results are those of the tables of samples beside them, by the scripts that draw figures."""

import csv
import math
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TABLES = ROOT / "docs" / "results" / "tables"

# Figures that need no coordinates, by the names of the workflows, and the tables that they are drawn from.
FIGURES = {
    "marschall-2018": {
        "fig05": ("fig05_phi_j.py", ("rods", "published")),
        "fig08": ("fig08_contact_number.py", ("rods", "published")),
        "pressure_lines": ("pressure_lines.py", ("--quasistatic", "above")),
    },
    "yuan-2019": {
        "fig03": ("fig03_phi_j.py", ("disordered",)),
        "fig04a": ("fig04_global_order.py", ("disordered",)),
        "fig05": ("fig05_asphericity.py", ("disordered",)),
        "fig06": ("fig05_asphericity.py", ("disordered", "--quantity", "z")),
    },
}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("paper", FIGURES)
def test_numbers_beside_the_paper_come_from_the_tables(paper, report, tmp_path):
    script = runpy.run_path(str(ROOT / "analysis" / "agreement.py"))
    folder = paper.replace("-", "_")
    results = {}
    for name, (drawn, words) in FIGURES[paper].items():
        paths = {word: TABLES / paper / f"{word}.csv" for word in words}
        asked = [path if path.exists() else word for word, path in paths.items()]
        out = tmp_path / f"{name}.png"
        results[name] = report(f"{folder}/{drawn}", *asked, "--out", out)
    with (TABLES / paper / "agreement.csv").open(newline="", encoding="utf-8") as file:
        told = {row["quantity"]: row for row in csv.DictReader(file)}
    compared = 0
    for published in script["read_paper"](ROOT / "analysis" / folder / "paper.csv"):
        ours = script["ours_of"](results, published)
        if published.result.split("/")[0] not in results or ours is None:
            continue
        row = told[published.quantity]
        assert float(row["ours"]) == pytest.approx(ours.value, rel=1e-6), published.quantity
        if math.isfinite(ours.error):
            assert float(row["our_error"]) == pytest.approx(ours.error, rel=1e-4)
        compared += 1
    assert compared >= 9
