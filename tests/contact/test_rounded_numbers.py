"""Double-doubles rounded to long doubles without long doubles."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).parent
SOURCES = HERE.parents[1] / "lammps_plugin"
COMPILER = shutil.which("g++")


@pytest.mark.skipif(COMPILER is None, reason="no g++")
@pytest.mark.parametrize("optimisation", ["-O0", "-O3"])
def test_double_doubles_round_to_the_bits_of_long_doubles(optimisation, tmp_path):
    program = tmp_path / "rounded_numbers"
    options = ["-std=c++17", optimisation, "-ffp-contract=off", f"-I{SOURCES}"]
    subprocess.run([COMPILER, *options, HERE / "rounded_numbers.cpp", "-o", program], check=True)
    different = json.loads(subprocess.run([program], check=True, capture_output=True).stdout)
    assert different == {"normal": 0, "larger rests": 0, "ties": 0, "zeros": 0}
