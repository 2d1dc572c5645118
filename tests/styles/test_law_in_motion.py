"""Laws of contacts in LAMMPS: ranks, restarts in the middle of a run, energy in dynamics without drag."""

import re

import numpy as np
import pytest
from every_shape import TYPICAL, pressed
from lammps_runs import after_restart, before_box, load_plugin, run_lmp_well
from thinned import in_turn, quick

from jamshape.files.lammps_text import write_data
from jamshape.shapes.shape import Interaction

pytestmark = pytest.mark.lammps

EVERY = pytest.mark.parametrize("case", TYPICAL, ids=str)
STEP = 1e-3


def nve(dimension, step=STEP):
    plane = "fix plane all enforce2d" if dimension == 2 else ""
    return f"set group all density 1\nfix move all nve/asphere\n{plane}\ntimestep {step!r}"


def deck(case, power, folder, dynamics):
    packing = pressed(case)
    style = packing.shape.style(packing, Interaction(1.7, 2, power))
    write_data(folder / "scene.data", packing.with_(species=style.types))
    command, *coefficients = style.commands.splitlines()
    return "\n".join([
        before_box(case.dimension, extra=load_plugin()), f"read_data {folder / 'scene.data'}", command, *coefficients,
        after_restart(), dynamics,
    ])  # fmt: skip


def rows_of(output):
    """(T, 3) energy: potential, kinetic of translations, of rotations."""
    found = re.findall(r"^energies (\S+) (\S+) (\S+)$", output, re.MULTILINE)
    return np.array(found, np.float64)


TELL = "compute spin all erotate/asphere\nthermo_style custom step pe ke c_spin\nthermo_modify norm no\nrun 0\n"
PRINT = 'print "energies $(pe:%.17g) $(ke:%.17g) $(c_spin:%.17g)"'


@pytest.mark.parametrize(("case", "power"), in_turn(TYPICAL, [2.5, 4.0]), ids=str)
def test_energy_is_conserved_without_drag(case, power, tmp_path, measured):
    """To second order in the time step, which is made half as long."""
    drifts = []
    for steps in (400, 800):
        dynamics = f"{nve(case.dimension, 2.0 / steps)}\n{TELL}{PRINT}\nrun {steps}\n{PRINT}"
        output = run_lmp_well(deck(case, power, tmp_path, dynamics), tmp_path)
        first, last = rows_of(output)
        moved = last[1:].sum() - first[1:].sum()
        drifts.append(abs(last.sum() - first.sum()) / first[0])
    measured(drift=drifts[1], moved=moved / first[0])
    assert moved > 1e-3 * first[0]
    assert drifts[1] < 2e-3 * moved / first[0]
    assert drifts[1] < 0.5 * drifts[0] + 1e-9


# The numbers that ranks exchange do not depend on the dimension.
@pytest.mark.parametrize("case", quick(TYPICAL, [c for c in TYPICAL if c.dimension == 2]), ids=str)
def test_ranks_do_not_matter(case, tmp_path):
    text = deck(case, 2.5, tmp_path, f"{nve(case.dimension)}\n{TELL}run 50\n{PRINT}")
    one, two = (rows_of(run_lmp_well(text, tmp_path, ranks))[0] for ranks in (1, 2))
    np.testing.assert_allclose(two, one, rtol=1e-10)


@EVERY
def test_a_restart_file_keeps_the_law(case, tmp_path):
    """Half of a run, and the other half from its restart file, without a pair style."""
    dynamics = f"{nve(case.dimension)}\n{TELL}run 100\nwrite_restart half.restart\nrun 100\n{PRINT}"
    whole = rows_of(run_lmp_well(deck(case, 2.5, tmp_path, dynamics), tmp_path))[0]
    again = [before_box(case.dimension, extra=load_plugin()), "read_restart half.restart"]
    again += [after_restart(), nve(case.dimension).partition("\n")[2], f"{TELL}run 100\n{PRINT}"]
    found = rows_of(run_lmp_well("\n".join(again), tmp_path))[0]
    np.testing.assert_allclose(found, whole, rtol=1e-9)
