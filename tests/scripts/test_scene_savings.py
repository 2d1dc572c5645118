"""analysis/scene_savings.py, and the list of the analysis scripts."""

import csv
import json
from pathlib import Path

import pytest

ANALYSIS = Path(__file__).parents[2] / "analysis"


@pytest.mark.lammps
def test_turning_things_back_on_changes_nothing_but_the_time(here, tmp_path, capsys):
    assert not here("scene_savings.py", "--quick", "--out", tmp_path)
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert report["differ"] == []
    rows = report["rows"]
    assert {row["scene"] for row in rows} == {"discs", "rods", "spheres", "spheroids"}
    assert all(row["difference"] < 1e-12 for row in rows)
    # Far beyond what a busy machine may do to the ratio of three turns.
    (search,) = [row for row in rows if row["scene"] == "spheres" and row["left_out"] == "search"]
    assert search["cost"] > 2
    table = (tmp_path / "scene_savings.md").read_text()
    assert "% of the listed pairs" in table
    with (tmp_path / "scene_savings.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(rows)


def test_every_script_is_listed():
    listed = (ANALYSIS / "README.md").read_text()
    missing = [path.name for path in ANALYSIS.glob("*.py") if f"| `{path.name}` |" not in listed]
    assert missing == []
