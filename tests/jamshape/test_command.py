import json
import signal
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

from jamshape.command import parser_of, plain, report, run
from jamshape.measures.averages import Mean


def test_plain_knows_what_scripts_report():
    found = {
        "out": Path("a.png"),
        "mean": Mean(1.0, float("nan"), 1),
        "rows": np.array([[1, 2]]),
        "count": np.int64(3),
        "pair": (np.float64("inf"), True),
        "text": None,
    }
    assert plain(found) == {
        "out": "a.png",
        "mean": {"value": 1.0, "error": None, "samples": 1},
        "rows": [[1, 2]],
        "count": 3,
        "pair": [None, True],
        "text": None,
    }


def test_report_is_one_line_of_json(capsys):
    report({"u0": 1e-15, "z": float("nan")})
    assert json.loads(capsys.readouterr().out, parse_constant=pytest.fail) == {
        "u0": 1e-15,
        "z": None,
    }


def ended(monkeypatch, main, *arguments):
    monkeypatch.setattr(sys, "argv", ["/some/where/script.py", *arguments])
    with pytest.raises(SystemExit) as end:
        run(parser_of("What it does.", "a.png"), main)
    return end.value.code


def test_a_script_ends_with_the_code_that_it_returns(monkeypatch):
    assert ended(monkeypatch, lambda options: int(options.out != Path("a.png"))) == 0
    assert ended(monkeypatch, lambda options: int(options.out != Path("a.png")), "--out", "b") == 1
    assert ended(monkeypatch, lambda _: None) is None


@pytest.mark.parametrize("kind", [ValueError, FileNotFoundError, RuntimeError])
def test_a_problem_is_one_sentence_after_the_name(monkeypatch, kind):
    def main(_):
        msg = "alpha is -1, expected more"
        raise kind(msg)

    assert ended(monkeypatch, main) == "script.py: alpha is -1, expected more"


def test_a_mistake_of_the_script_is_not_hidden(monkeypatch):
    def main(_):
        raise KeyError

    monkeypatch.setattr(sys, "argv", ["script.py"])
    with pytest.raises(KeyError):
        run(parser_of("What it does."), main)


INTERRUPTED = """
import atexit, os, signal, time
from jamshape.command import sentences
atexit.register(os.kill, os.getpid(), signal.SIGINT)
with sentences("x"):
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(30)
"""


def test_a_second_ctrl_c_does_not_cut_the_end_off():
    # Whoever started the tests may have told them to ignore it.
    heard = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        command = [sys.executable, "-c", INTERRUPTED]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
    finally:
        signal.signal(signal.SIGINT, heard)
    assert done.stderr == "\nx: interrupted; it may be started again\n"
    assert done.returncode == 130


def test_help_is_the_docstring(monkeypatch, capsys):
    assert ended(monkeypatch, lambda _: None, "--help") == 0
    assert "What it does.\n" in capsys.readouterr().out


def test_a_warning_is_one_sentence_after_the_name(monkeypatch, capsys):
    def warned(_):
        warnings.simplefilter("always")
        warnings.warn("the rate is high", stacklevel=1)

    shown = warnings.showwarning
    assert ended(monkeypatch, warned) is None
    assert capsys.readouterr().err.endswith(": warning: the rate is high\n")
    assert warnings.showwarning is shown
