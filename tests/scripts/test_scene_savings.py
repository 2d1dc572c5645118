"""analysis/benchmarks/scene_savings.py."""

import csv
import json

import pytest


@pytest.mark.lammps
def test_turning_things_back_on_changes_nothing_but_the_time(here, tmp_path, capsys):
    assert not here("benchmarks/scene_savings.py", "--quick", "--out", tmp_path)
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert report["differ"] == []
    rows = report["rows"]
    assert {row["scene"] for row in rows} == {"discs", "rods", "dimers", "spheres", "spheroids"}
    # Where it is measured by steps, what forces are rounded to in another order grows along them.
    assert all(row["difference"] < (1e-11 if row["per"] == "step" else 1e-12) for row in rows)
    # Far beyond what a busy machine may do to the ratio of three turns.
    (search,) = [row for row in rows if row["scene"] == "spheres" and row["left_out"] == "search"]
    assert search["cost"] > 2
    table = (tmp_path / "scene_savings.md").read_text()
    assert "% of the listed pairs" in table
    with (tmp_path / "scene_savings.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(rows)
