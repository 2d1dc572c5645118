"""The script `run`, as far as it goes without setting anything up."""

import re
import subprocess
from pathlib import Path

import pytest

RUN = Path(__file__).parents[2] / "run"
PARTS = ("setup", "demo", "test", "lint", "sanitize")


def run(*words):
    return subprocess.run([RUN, *words], capture_output=True, text=True, timeout=60, check=False)


@pytest.mark.parametrize("words", [(), ("--help",)])
def test_run_says_what_it_does(words):
    done = run(*words)
    assert (done.returncode, done.stderr) == (0, "")
    assert sorted(re.findall(r"^  \./run (\w+)", done.stdout, re.MULTILINE)) == sorted(PARTS)


def test_unknown_words_are_refused():
    done = run("sing")
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.strip() == (
        "./run: there is no 'sing', expected setup, demo, test, lint or sanitize; ./run shows what they do."
    )


def parts(command):
    """The functions of the script, and a command after them, in a shell of its own."""
    functions = RUN.read_text(encoding="utf-8").split('case "${1:-help}"')[0]
    functions = functions.replace('cd "$(dirname "${BASH_SOURCE[0]}")"\n', "")
    return ["bash", "-c", f"{functions}\n{command}"]


def test_a_stage_tells_the_newest_line_the_time_and_how_it_ended(tmp_path):
    command = "speak() { echo '[1/9] file'; echo noise; sleep 2; }"
    command += "; EVERY=1; stage Compiling '\\[.*' 'look elsewhere' speak"
    done = subprocess.run(parts(command), cwd=tmp_path, capture_output=True, text=True, check=True)
    title, *shown, end = done.stdout.strip().splitlines()
    assert title == "== Compiling"
    assert shown
    assert all(re.fullmatch(r"   \d s  \[1/9\] file", line) for line in shown)
    assert re.fullmatch(r"   done in \d s", end)


def test_a_stage_that_fails_says_what_to_do(tmp_path):
    command = "broken() { echo noise; echo 'fatal error: no such file'; return 3; }"
    command += "; stage Compiling '.*' 'look elsewhere' broken"
    done = subprocess.run(parts(command), cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "done" not in done.stdout
    assert done.stderr.splitlines() == [
        "fatal error: no such file",
        "",
        "./run: this did not work: look elsewhere; all that was said is in build/setup.log.",
    ]
    assert "noise" in (tmp_path / "build" / "setup.log").read_text()
