import argparse
import json
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ERRORS = ROOT / "analysis" / "errors"


@pytest.fixture
def error_report(monkeypatch):
    monkeypatch.syspath_prepend(str(ERRORS))
    module = __import__("error_report")
    command = "analysis/errors/contact_error.py --pairs 3 --out ."
    few = module.STUDIES["contact"]._replace(short=[command])
    bad = few._replace(title="Fails", short=["analysis/errors/spectrum_error.py none.h5"])
    monkeypatch.setattr(module, "STUDIES", {"contact": few, "bad": bad})
    return module


def options(out, **changes):
    told = {"out": out, "full": False, "only": ["contact"], "again": False} | changes
    return argparse.Namespace(**told)


def test_a_study_is_run_once_and_its_page_regenerates_it(error_report, tmp_path, capsys):
    assert error_report.main(options(tmp_path)) == 0
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert report["studies"] == ["contact"]
    page = (tmp_path / "report.md").read_text()
    assert "    .venv/bin/python analysis/errors/contact_error.py --pairs 3 --out ." in page
    assert "| p | w | largest gap |" in page
    assert "numpy" in page
    assert "](overview.png)" in page
    curves = json.loads((tmp_path / "contact" / "record.json").read_text())["curves"]
    assert all(0 < e < 1e-11 for curve in curves for e in curve["error"])
    assert all(0 < s < 1e-3 for curve in curves for s in curve["seconds"])
    picture = tmp_path / "contact" / "contact_error.png"
    assert f"({picture.relative_to(tmp_path)})" in page
    drawn = picture.stat().st_mtime_ns
    assert error_report.main(options(tmp_path)) == 0
    assert picture.stat().st_mtime_ns == drawn
    assert (tmp_path / "overview.png").stat().st_size > 5000
    finished = tmp_path / "contact" / "finished_run.json"
    finished.touch()
    assert error_report.main(options(tmp_path, again=True)) == 0
    assert picture.stat().st_mtime_ns > drawn
    assert not finished.exists()


def test_a_study_that_fails_does_not_stop_the_others(error_report, tmp_path, capsys):
    assert error_report.main(options(tmp_path, only=["bad", "contact"])) == 1
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert set(report["failed"]) == {"bad"}
    assert "none.h5" in report["failed"]["bad"]
    page = (tmp_path / "report.md").read_text()
    assert "**Failed:**" in page
    assert "| p | w |" in page
    assert "](overview.png)" in page


def test_scripts_of_all_studies_exist(monkeypatch):
    monkeypatch.syspath_prepend(str(ERRORS))
    sys.modules.pop("error_report", None)
    for study in __import__("error_report").STUDIES.values():
        for command in (*study.short, *study.full):
            assert (ROOT / command.split()[0]).is_file()
