"""The cases of analysis/stability/stability_report.py, one test each, and the report itself."""

import argparse
import ast
import json
import sys
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

STABILITY = Path(__file__).parents[2] / "analysis" / "stability"
sys.path.insert(0, str(STABILITY))

import stability_report
from battery.case import Case
from battery.cases import all_cases

pytestmark = pytest.mark.lammps

# What is known to fail, with the reason.
_LINE_SEARCH = (
    "LAMMPS's quadratic line search goes back where all contacts open in one step: energy ratio 1, "
    "0 with backtrack, which the deck uses"
)
_FREE_MOTION = (
    "a single contact below jamming may open and close by more than its overlap at a kappa of 1e-14: "
    "free motion is resolved to sqrt(overlap size) only, as docs/explanation/slow-compressions.md says"
)
_NO_MODES = (
    "overlaps of a third of rods: the minimum lies on a corner, where a bond goes from one rod's tip to the "
    "other's and second derivatives jump, so that there are no modes"
)
_FLAT_ON_FLAT = (
    "flat faces of p = 10 that lie on each other: a turn by 1e-14 takes the torque through its balance, and "
    "angles are known to 1e-16 or 1e-19: forces balance, torques to a few tenths of a bond's"
)
KNOWN = {
    **{
        f"quasistatic compression: {case}": _FLAT_ON_FLAT
        for case in (
            "2D, p 10, w 0.1",
            "2D, p 10, w 1",
            "3D, p 10, w 0.1",
            "3D, p 10, w 1",
            "3D, p 10, w 10",
        )
    },
    "spectrum: overlaps of a third": _NO_MODES,
    "spectrum: 3D, overlaps of a third": _NO_MODES,
    **{
        f"implicit compression: kappa {case} of the steady overlap": _FREE_MOTION
        for case in ("1e-14, tr-bdf2, from 1", "1e-14, tr-bdf2, from 10")
    },
    **{
        f"LAMMPS minimize, spherocylinders: alpha 1e-6 to 100 in one box, {style}, line quadratic": _LINE_SEARCH
        for style in ("cg", "sd")
    },
}
_OF_SOME_MINIMA = (_FREE_MOTION, _FLAT_ON_FLAT, _NO_MODES)


def marked(case):
    marks = [pytest.mark.validate] if case.heavy else []
    if case.label in KNOWN:
        reason = KNOWN[case.label]
        marks.append(pytest.mark.xfail(reason=reason, strict=reason not in _OF_SOME_MINIMA))
    return pytest.param(case, id=case.label, marks=marks)


@pytest.mark.parametrize("case", [marked(case) for case in all_cases()])
def test_extreme_case(case, measured):
    verdict = case.judge()
    if not isinstance(verdict.measured, str):
        measured(error=verdict.measured)
    assert verdict.holds, f"{case.measure}: {verdict.measured}, expected {case.expected}"


def refuse():
    msg = "found 3, expected 2"
    raise ValueError(msg)


def test_verdicts():
    def of(expected, run):
        return Case("part", "name", "error", expected, run).judge()

    assert of(1.0, lambda: 0.5).holds
    assert not of(1.0, lambda: 2.0).holds
    assert not of(1.0, lambda: float("nan")).holds
    assert not of(1.0, refuse).holds
    assert of("found 3", refuse).holds
    assert not of("found 4", refuse).holds
    assert not of("found 3", lambda: 0.0).holds


def options(out, **changes):
    told = {"out": out, "only": "wn images: contacts", "quick": False, "again": False} | changes
    return argparse.Namespace(**told)


def test_report_goes_on_and_says_what_fails(tmp_path, capsys):
    assert stability_report.main(options(tmp_path)) == 0
    last = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert last["failed"] == []
    assert last["cases"] >= 2
    page = (tmp_path / "report.md").read_text()
    assert "| own images: contacts |" in page
    assert "| holds |" in page
    path = tmp_path / "verdicts.json"
    records = json.loads(path.read_text())
    for record in records.values():
        record["seconds"] = 77.0
    first = next(iter(records))
    records[first] |= {"measured": 5.0, "holds": False}
    path.write_text(json.dumps(records))
    assert stability_report.main(options(tmp_path)) == 0
    again = json.loads(path.read_text())
    assert again[first]["seconds"] < 77.0  # repeated, having failed
    assert sum(record["seconds"] == 77.0 for record in again.values()) == len(again) - 1


def test_a_process_that_ends_is_a_verdict(tmp_path):
    found = list(stability_report.verdicts(["no such case"], tmp_path / "log"))
    assert not found[0].holds
    assert "KeyError" in found[0].measured


def test_nothing_of_that_name(tmp_path):
    with pytest.raises(ValueError, match="no case is called 'unheard of'"):
        stability_report.main(options(tmp_path, only="unheard of"))


def test_modules_import_one_another_in_no_circle():
    graph = {}
    for path in (STABILITY / "battery").rglob("*.py"):
        imports = [
            x for x in ast.walk(ast.parse(path.read_text())) if isinstance(x, ast.ImportFrom)
        ]
        both = {f"{x.module}.{alias.name}" for x in imports for alias in x.names}
        name = ".".join(path.relative_to(STABILITY).with_suffix("").parts)
        graph[name] = both | {x.module for x in imports}
    order = [name for name in TopologicalSorter(graph).static_order() if name in graph]
    assert order[-1] == "battery.cases"
