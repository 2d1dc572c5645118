"""exp, log, log1p and pow of packs, compiled for every set of instructions, beside those of long doubles."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from jamshape import _contact

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "lammps_plugin"
FLAGS = {"baseline": [], "avx2": ["-mavx2"], "avx512": ["-mavx512f", "-mavx512dq"]}
COMPILER = shutil.which("g++")


@pytest.mark.skipif(COMPILER is None, reason="no g++")
@pytest.mark.parametrize("name", [name for name in _contact.instruction_sets() if name in FLAGS])
def test_functions_of_packs_err_by_few_roundings(name, tmp_path):
    program = tmp_path / "pack_functions"
    options = ["-std=c++17", "-O2", "-ffp-contract=off", f"-DJAMSHAPE_SET={name}", *FLAGS[name]]
    source = HERE / "pack_functions.cpp"
    subprocess.run([COMPILER, *options, f"-I{SOURCES}", source, "-o", program], check=True)
    errors = json.loads(subprocess.run([program], check=True, capture_output=True).stdout)
    assert errors.pop("ends") == [1] * 7
    powers = {name: errors.pop(name) for name in list(errors) if name.startswith("pow")}
    assert max(errors.values()) < 2.0, errors
    # The relative error of x^power is that of power * ln x, below 11 here.
    assert max(powers.values()) < 12.0, powers
    assert min([*errors.values(), *powers.values()]) > 0.1
