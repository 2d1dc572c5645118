"""The script `run`, as far as it goes without setting anything up."""

import re
import subprocess
import sys
from pathlib import Path

import pytest
from valgrind_decks import found_in

RUN = Path(__file__).parents[2] / "run"
PARTS = ("setup", "demo", "test", "lint", "docs", "sanitize", "sdist", "valgrind", "wheel")


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
        "./run: unknown command 'sing', expected setup, demo, test, lint, docs, sanitize, sdist, valgrind or wheel; ./run describes them."
    )


@pytest.mark.parametrize("sign", ['"', "$", "`", ";", ":", "\\", "\n"])
def test_a_folder_that_cmake_or_shells_misread_is_refused_before_anything_runs(sign, tmp_path):
    folder = tmp_path / f"my{sign}clone"
    folder.mkdir()
    script = folder / "run"
    script.write_bytes(RUN.read_bytes())
    script.chmod(0o755)
    done = subprocess.run([script, "demo"], capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith(
        f"\n./run: the folder is {folder}, expected a path without quotes"
    )
    assert done.stderr.endswith("move it to another one.\n")
    assert [path.name for path in folder.iterdir()] == ["run"]


STACK = "<stack><frame><obj>{}</obj><fn>first</fn></frame><frame><obj>lmp</obj></frame></stack>"
ERROR = "<error><kind>{}</kind><what>said</what>{}</error>"


def test_valgrind_counts_where_the_plugin_is_on_the_stack(tmp_path):
    stacks = [STACK.format(place) for place in ("/lib/jamshape_plugin.so", "/lib/libmpi.so")]
    own, other = (ERROR.format("InvalidRead", stack) for stack in stacks)
    second = ERROR.format("UninitValue", "".join(reversed(stacks)))  # where the value came from
    report = tmp_path / "report.xml"
    report.write_text(f"<valgrindoutput>{own}{other}{second}</valgrindoutput>")
    ours, others = found_in(report)
    assert (len(ours), others) == (2, 1)
    assert ours[0].startswith("InvalidRead: said\n    first")


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
        "./run: this step failed: look elsewhere; the full output is in build/setup.log.",
    ]
    assert "noise" in (tmp_path / "build" / "setup.log").read_text()


SMALL = (
    "DEMO_RODS=(--alpha 4 --n 16); DEMO_RUN=(--kappa 1e-5 --phi-start 0.75 --phi-end 0.92);"
    " DEMO_SEEDS=(1 2)"
)


@pytest.mark.lammps
def test_the_demo_draws_what_it_says_and_puts_its_numbers_beside_the_papers(tmp_path):
    (tmp_path / "analysis").symlink_to(RUN.parent / "analysis")
    command = parts(f"{SMALL}; PYTHON={sys.executable}; demo")
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    for name in ("pressure", "packing", "density_of_states"):
        picture = (tmp_path / "runs" / "demo" / f"{name}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 10_000
        assert f"   {name}.png" in done.stdout
    found = re.findall(r"^   (\w.*?)  +(\d)  +(.+)$", done.stdout, re.MULTILINE)
    rows = {name: numbers for name, _, numbers in found}
    assert {name: samples for name, samples, _ in found}["z of all bonds"] == "2"
    assert rows["phi_J(kappa = 1e-05), p to 0"].endswith("0.866")
    assert 0.7 < float(rows["phi_J, u0 = 1e-15 to 0"].split()[0]) < 0.95
    assert 5 < float(rows["z of all bonds"].split()[0]) < 6.5
    bands = [
        float(rows[f"modes in the {band} band"].split()[0]) for band in ("low", "middle", "high")
    ]
    assert sum(bands) == pytest.approx(1, abs=2e-3)  # rounded
    (verdict,) = re.findall(r"^   phi_J\(kappa = .*stays jammed\.$", done.stdout, re.MULTILINE)
    assert verdict.strip() in (tmp_path / "runs" / "demo" / "said.txt").read_text()


@pytest.mark.lammps
def test_a_demo_whose_packing_fails_says_why(tmp_path):
    (tmp_path / "analysis").symlink_to(RUN.parent / "analysis")
    broken = "demo_packings() { echo 'there was none' >$DEMO/packings.log; return 1; }"
    command = parts(f"PYTHON=true; {broken}; demo")  # nor is anything else made
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.endswith("./run: no packing was made: there was none\n")
    assert "Done" not in done.stdout
