"""Verdicts of extreme cases, and the page of tables that `--report` writes."""

import json
import subprocess
import sys
from types import SimpleNamespace

import pytest
from extreme import case, extreme, judge
from lammps_runs import REPOSITORY
from tables import Tables


def refuse():
    msg = "found 3, expected 2"
    raise ValueError(msg)


def test_verdicts():
    def holds(expected, run):
        return judge(run, expected).holds

    assert holds(1.0, lambda: 0.5)
    assert not holds(1.0, lambda: 2.0)
    assert not holds(1.0, lambda: float("nan"))
    assert not holds(1.0, lambda: None)
    assert not holds(1.0, refuse)
    assert holds("found 3", refuse)
    assert not holds("found 4", refuse)
    assert not holds("found 3", lambda: 0.0)
    assert not holds("found 3", lambda: None)


def report_of(page, *words):
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-n",
        "0",
        "tests/extremes/test_extreme_landscape.py",
    ]
    done = subprocess.run(
        [*command, "-k", "own and images and contacts", "--report", page, *words],
        cwd=REPOSITORY, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout
    return page.read_text(), [
        json.loads(x) for x in page.with_suffix(".jsonl").read_text().splitlines()
    ]


def test_report_goes_on_and_repeats_what_fails(tmp_path):
    page, rows = report_of(tmp_path / "report.md")
    assert "| own images: contacts |" in page
    assert "| holds |" in page
    assert len(rows) >= 2
    rows[0]["passed"] = False
    kept = tmp_path / "report.jsonl"
    kept.write_text("".join(f"{json.dumps(row)}\n" for row in rows))
    again = report_of(tmp_path / "report.md")[1]
    assert [x["test"] for x in again] == [x["test"] for x in (*rows, rows[0])]
    assert again[-1]["passed"]


def test_a_process_that_ends_has_a_row(tmp_path):
    tables = Tables(tmp_path / "report.md")
    crash = SimpleNamespace(nodeid="test[a]", user_properties=[], failed=True, passed=False, when="???",
                            longrepr="worker 'gw0' crashed while running 'test[a]'")  # fmt: skip
    tables.pytest_runtest_logreport(crash)
    tables.pytest_sessionfinish()
    assert "1 rows, 1 of which do not hold" in (tmp_path / "report.md").read_text()
    assert "| test[a] | worker 'gw0' crashed" in (tmp_path / "report.md").read_text()


@pytest.mark.parametrize("bound", [0.0, "no such sentence"])
def test_a_wrong_verdict_fails(bound, tmp_path):
    def measure():
        return 1.0

    test = extreme("an error", [case(f"part: {bound}", expected=bound)])(measure)
    (one,) = (parameter.values[0] for parameter in test.pytestmark[0].args[1])
    rows = []
    with pytest.raises(AssertionError, match="expected"):
        test(one, lambda *row: rows.append(row), lambda **_: None, tmp_path)
    assert rows[0][1]["verdict"] == "**FAIL**"
