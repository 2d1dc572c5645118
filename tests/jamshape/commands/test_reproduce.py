"""Refusals of `jamshape reproduce` before any job; tests/scripts/test_reproduce_with_snakemake.py plans its jobs."""

import importlib.util
import json
import sys
import time

import pytest

from jamshape.commands import reproduce

PAPER = "marschall-2018"


@pytest.fixture(autouse=True)
def _with_snakemake(monkeypatch):
    """Pretend that Snakemake is installed: none of these tests starts it."""
    find = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *more: name == "snakemake" or find(name, *more)
    )


def test_a_paper_of_the_list_is_asked_for(jamshape, capfd):
    assert jamshape("reproduce", "einstein-1905").code == 2
    assert "invalid choice: 'einstein-1905'" in capfd.readouterr().err


def test_no_snakemake_is_told_with_how_to_install_it(jamshape, monkeypatch, tmp_path):
    monkeypatch.setattr(importlib.util, "find_spec", lambda *_: None)
    said = jamshape("reproduce", PAPER, "--out", tmp_path / "new").code
    assert said.startswith("jamshape reproduce: found no snakemake in ")
    assert said.endswith("-m pip install --group sweep' in the clone")
    assert not (tmp_path / "new").exists()


def test_a_package_without_its_clone_is_told_so(jamshape, monkeypatch, tmp_path):
    installed = tmp_path / "lib" / "python" / "jamshape" / "commands" / "reproduce.py"
    monkeypatch.setattr(reproduce, "__file__", str(installed))
    monkeypatch.chdir(tmp_path)
    said = jamshape("reproduce", PAPER, "--out", tmp_path / "new").code
    assert "found no analysis/marschall_2018/reproduce.smk in " in said
    assert said.endswith("run it in the clone")
    workflow = tmp_path / "analysis" / "marschall_2018" / "reproduce.smk"
    workflow.parent.mkdir(parents=True)
    workflow.touch()
    assert reproduce.workflow_of(PAPER) == workflow


def test_less_than_one_job_is_refused(jamshape, tmp_path):
    said = jamshape("reproduce", PAPER, "--jobs", 0, "--out", tmp_path / "new").code
    assert said == "jamshape reproduce: --jobs is 0, expected at least 1"


def test_less_than_one_sample_is_refused(jamshape, tmp_path):
    said = jamshape("reproduce", PAPER, "--samples", 0, "--out", tmp_path / "new").code
    assert said == "jamshape reproduce: --samples is 0, expected at least 1"
    assert not (tmp_path / "new").exists()


def test_a_folder_of_something_else_is_refused(jamshape, tmp_path):
    (tmp_path / "reproduced.json").write_text(json.dumps({"paper": PAPER, "scale": "small"}))
    said = jamshape("reproduce", PAPER, "--out", tmp_path).code
    assert said == (
        f"jamshape reproduce: {tmp_path} holds {PAPER} at the scale small, expected {PAPER} at the"
        " scale demo; choose another --out"
    )


def test_a_folder_in_which_another_process_works_is_refused(jamshape, tmp_path):
    with reproduce.held(tmp_path):
        said = jamshape("reproduce", PAPER, "--out", tmp_path).code
    assert said.endswith(
        f"another process makes files in {tmp_path}, expected none; wait until it ends"
    )
    with reproduce.held(tmp_path):
        pass


SLOW = """
import sys, time
print("1 of 5 steps (20%) done", flush=True)
try:
    time.sleep(60)
except KeyboardInterrupt:
    print("Error in rule packing:\\n    output: reports/packing.json, x\\n", flush=True)
    sys.exit(1)
"""


def test_it_stops_in_time_as_after_ctrl_c(jamshape, monkeypatch, tmp_path, capfd):
    monkeypatch.setattr(reproduce, "command_of", lambda *_: [sys.executable, "-c", SLOW])
    out = tmp_path / "new"
    began = time.monotonic()
    assert jamshape("reproduce", PAPER, "--seconds", 2, "--out", out).code == 75
    assert time.monotonic() - began < 30
    said = capfd.readouterr().err.splitlines()[-1]
    assert said == (
        f"jamshape reproduce: {out}: stopped after 2 s at 1 of 5 jobs, expected the end; the same command resumes"
    )


def test_no_time_at_all_is_refused(jamshape, tmp_path):
    said = jamshape("reproduce", PAPER, "--seconds", -1, "--out", tmp_path / "new").code
    assert "--seconds is -1" in said
