import io
import re
import sys

import pytest

from jamshape.front import progress
from jamshape.front.progress import Told, follow

LINE = re.compile(
    r"(?P<phase>[a-z ]+): (?P<part>[0-9.]+) % "
    r"\[(?P<gone>[0-9:]+), remain (?P<rest>[0-9:?]+)\] (?P<text>.*)"
)


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture(name="clock")
def clock_(monkeypatch):
    """Time that passes only when a step says so, in a process that has no notebook."""
    now = [100.0]
    monkeypatch.setattr(progress.time, "perf_counter", lambda: now[0])
    monkeypatch.delitem(sys.modules, "ipykernel", raising=False)
    return now


def steps_of(clock, phases, seconds):
    for phase, parts in phases:
        for part in parts:
            clock[0] += seconds
            yield Told(phase, f"at {part}", part)


def said(clock, capsys, phases, seconds=1.0, **options):
    follow(steps_of(clock, phases, seconds), lambda at: at, **options)
    return capsys.readouterr().err.splitlines()


def test_a_log_has_a_line_in_ten_seconds_with_what_remains(clock, capsys):
    lines = said(clock, capsys, [("compression", [k / 100 for k in range(1, 101)])])
    assert len(lines) == 11
    found = [LINE.fullmatch(line).groupdict() for line in lines]
    assert [f["part"] for f in found[:3]] == ["1.0", "11.0", "21.0"]
    assert found[1]["gone"] == "00:10"
    # 10 s for 11 %, from which the first step is not told apart.
    assert found[1]["rest"] == "01:20"
    assert found[-1] | {"gone": ""} == {
        "phase": "compression", "part": "100.0", "gone": "", "rest": "00:00", "text": "at 1.0",
    }  # fmt: skip
    assert "\r" not in "".join(lines)


def test_what_was_done_before_does_not_count_for_what_remains(clock, capsys):
    parts = [0.5 + k / 100 for k in range(1, 51)]
    lines = said(clock, capsys, [("compression", parts)], begun=0.5)
    assert LINE.fullmatch(lines[1])["rest"] == "00:35"  # 39 % at 11 % in 10 s


def test_every_phase_begins_and_ends_with_a_line(clock, capsys):
    lines = said(clock, capsys, [("compression", [0.5, 1.0]), ("search for u0", [None] * 3)], 0.1)
    assert [line.split(":")[0] for line in lines] == 2 * ["compression"] + 2 * ["search for u0"]
    assert lines[-1] == "search for u0: [00:00] at None"


def test_a_terminal_has_a_bar_for_each_phase(clock, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    phases = [("compression", [0.25, 1.0]), ("search for u0", [None] * 3)]
    follow(steps_of(clock, phases, 1.0), lambda at: at._replace(aside=None))
    text = sys.stderr.getvalue()
    assert "compression:100.0 %|" in text
    assert "at 1.0" in text
    last = text.rstrip().splitlines()[-1].split("\r")[-1]
    assert last.startswith("search for u0 [")
    assert last.endswith("at None")


def test_nothing_is_said_when_nothing_is_asked_for(clock, capsys):
    assert said(clock, capsys, [("compression", [1.0])], shown=False) == []


@pytest.mark.usefixtures("clock")
def test_a_failure_comes_below_the_last_line(capsys):
    def failing():
        yield Told("compression", "fine", 0.1)
        yield Told("compression", "last", 0.2)
        msg = "no room"
        raise ValueError(msg)

    with pytest.raises(ValueError, match="no room"):
        follow(failing(), lambda at: at)
    assert capsys.readouterr().err.splitlines()[-1].endswith("last")
