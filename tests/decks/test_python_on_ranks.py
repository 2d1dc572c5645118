"""The script of docs/how-to/python-on-ranks.md: on two ranks, again from its restart file, and its dump in jamshape."""

import re
import sys
from pathlib import Path

import pytest
from lammps_runs import MPIRUN, run_program

import jamshape as js
from jamshape.lammps.plugin import plugin_path

pytestmark = pytest.mark.lammps

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "python-on-ranks.md").read_text()


def test_two_ranks_go_on_from_their_restart(tmp_path):
    [script] = re.findall(r"```\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "drive.py").write_text(script)
    frames = []
    for restart in ([], ["state.restart"]):
        words = [
            *MPIRUN,
            "-np",
            "2",
            sys.executable,
            "drive.py",
            str(plugin_path().parent),
            *restart,
        ]
        done = run_program(words, tmp_path)
        assert done.returncode == 0, done.stdout
        frames += js.frames(tmp_path / "state.dump", shape="spherocylinder")
    assert [frame.step for frame in frames] == [0, 1000, 2000, 2000, 3000, 4000]
    one, again = frames[2:4]
    assert abs(one.position - again.position).max() < 1e-12
    assert js.minimise(frames[-1], progress=False).reached
