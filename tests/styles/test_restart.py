"""write_restart and read_restart of the pair style and of fix overdamped/affine."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_runs import (
    after_restart,
    fix_vector,
    loaded,
    refusal_of,
    restarted,
    state_of,
)
from lammps_scenes import dense, pose_differences

pytestmark = pytest.mark.lammps

KAPPA, DT, STEPS = 1.3e-3, 0.07, 150

# The first number of the fix in restart files, which tells formats apart.
FORMAT = 0x6A616D7368617003


def fix(kappa=KAPPA, dt=DT, options=""):
    return f"""
        fix drive all overdamped/affine drag 1.3 compress {kappa} {options}
        timestep {dt}"""


@pytest.fixture(scope="module")
def rods():
    return dense(n=32, phi=0.9)


# --- what the fix takes from the file, and what from its command ----------------------------------


@pytest.fixture
def halfway(rods, tmp_path):
    """State at half time, and the path of the restart file written there."""
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun {STEPS}\nwrite_restart {tmp_path / 'half.restart'}")
        return state_of(session), tmp_path / "half.restart"


def strain_of(box, start):
    return -np.log(box.edges / start.edges)


@pytest.mark.parametrize(("kappa", "dt"), [(-2.7e-3, DT), (KAPPA, 0.011), (0.0, 0.03)])
def test_new_rate_or_time_step_goes_on_from_the_present_strain(kappa, dt, halfway, rods):
    state, path = halfway
    with restarted(path, after_restart() + fix(kappa, dt)) as session:
        session.commands("run 0")
        assert fix_vector(session, "drive", 2) == pytest.approx(KAPPA * DT * STEPS, rel=1e-15)
        np.testing.assert_array_equal(state_of(session).packing.box.edges, state.packing.box.edges)
        session.commands("run 100")
        strain = KAPPA * DT * STEPS + kappa * dt * 100
        assert fix_vector(session, "drive", 2) == pytest.approx(strain, rel=1e-14)
        box = state_of(session).packing.box
    np.testing.assert_allclose(strain_of(box, rods.box), strain, rtol=1e-13)


def test_time_step_may_change_between_runs(rods, tmp_path):
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 40\ntimestep 0.01\nrun 60\nrun 10\ntimestep {DT}\nrun 5")
        strain = KAPPA * (45 * DT + 70 * 0.01)
        assert fix_vector(session, "drive", 2) == pytest.approx(strain, rel=1e-14)
        box = state_of(session).packing.box
    np.testing.assert_allclose(strain_of(box, rods.box), strain, rtol=1e-13)


@pytest.mark.parametrize("after_a_restart", [False, True])
def test_new_fix_starts_anew(after_a_restart, halfway, rods, tmp_path):
    state, path = halfway
    if after_a_restart:  # a fix of another name leaves the stored state alone
        instance = restarted(path, after_restart() + fix().replace("fix drive", "fix other"))
        name = "other"
    else:
        instance = loaded(rods, tmp_path, sides="two")
        name = "drive"
    with instance as session:
        if not after_a_restart:
            session.commands(f"{fix()}\nrun {STEPS}\nunfix drive\n{fix()}")
        session.commands("run 0")
        assert fix_vector(session, name, 2) == 0.0
        again = state_of(session)
        np.testing.assert_array_equal(again.packing.box.edges, state.packing.box.edges)
        assert pose_differences(again, state)[0] == 0.0
        session.commands("run 100")
        assert fix_vector(session, name, 2) == pytest.approx(KAPPA * DT * 100, rel=1e-14)
        box = state_of(session).packing.box
    np.testing.assert_allclose(strain_of(box, state.packing.box), KAPPA * DT * 100, rtol=1e-12)


@pytest.mark.parametrize("change", ["displace_atoms all move 0.01 0.02 0.0", "change_box all x scale 0.99 y scale 0.99 remap"])  # fmt: skip
def test_state_that_something_else_changed_is_taken_as_it_is(change, rods, tmp_path):
    """The fix keeps coordinates of its own; they follow what other commands do between runs."""
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 50\n{change}\nunfix drive\nrun 0")
        changed = state_of(session)
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 50\n{change}\nrun 0")
        seen = state_of(session)
        session.commands("run 1")
        after = state_of(session)
    np.testing.assert_array_equal(seen.packing.position, changed.packing.position)
    np.testing.assert_array_equal(seen.packing.box.edges, changed.packing.box.edges)
    assert pose_differences(after, changed)[0] < 1e-3


def test_a_restart_file_of_another_version_is_refused(rods, tmp_path):
    path, mark = tmp_path / "half.restart", FORMAT.to_bytes(8, "little")
    with loaded(rods, tmp_path) as session:
        session.commands(f"{fix()}\nrun 1\nwrite_restart {path}")
    content = path.read_bytes()
    assert content.count(mark) == 1
    path.write_bytes(content.replace(mark, bytes(8)))
    sentence = refusal_of(f"read_restart {path}\n{after_restart()}\n{fix()}")
    assert "found a restart file of another version of jamshape" in sentence


def test_a_restart_file_without_the_time_is_read(rods, tmp_path):
    """As written before the fix counted time across changes of the time step."""
    path, mark = tmp_path / "half.restart", FORMAT.to_bytes(8, "little")
    with loaded(rods, tmp_path) as session:
        session.commands(f"{fix()}\nrun 10\nwrite_restart {path}")
    path.write_bytes(path.read_bytes().replace(mark, (FORMAT - 1).to_bytes(8, "little")))
    with restarted(path, after_restart() + fix()) as session:
        session.commands("run 5")
        assert fix_vector(session, "drive", 1) == pytest.approx(15 * DT, rel=1e-14)
        assert fix_vector(session, "drive", 2) == pytest.approx(15 * DT * KAPPA, rel=1e-14)


def test_minimisation_leaves_strain_and_time_where_they_were(rods, tmp_path):
    """LAMMPS counts its iterations as steps; a restart file written after it knows, too."""
    path = tmp_path / "after.restart"
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(f"""
            {fix()}
            run 20
            minimize 0.0 0.0 30 300
            write_restart {path}""")
        assert session.step > 20
        session.commands("timestep 0.02\nrun 10")
        step, box = session.step, state_of(session).packing.box
        assert fix_vector(session, "drive", 1) == pytest.approx(20 * DT + 10 * 0.02, rel=1e-14)
        assert fix_vector(session, "drive", 2) == pytest.approx(KAPPA * (20 * DT + 0.2), rel=1e-14)
    np.testing.assert_allclose(strain_of(box, rods.box), KAPPA * (20 * DT + 0.2), rtol=1e-12)
    with restarted(path, after_restart() + fix(dt=0.02)) as session:
        session.commands("run 10")
        assert session.step == step
        np.testing.assert_array_equal(state_of(session).packing.box.edges, box.edges)
        assert fix_vector(session, "drive", 1) == pytest.approx(20 * DT + 10 * 0.02, rel=1e-14)


def test_numbers_of_forces_before_a_run_are_not_there(rods, tmp_path):
    """Neither before the first run nor after another pair style or particles have come."""
    with loaded(rods, tmp_path, sides="two") as session:
        session.commands(fix())
        asked = {k: fix_vector(session, "drive", k) for k in range(1, 21)}
        assert {k for k, value in asked.items() if np.isnan(value)} == {5, 20}
        session.commands("run 1")
        assert fix_vector(session, "drive", 5) > 0
        session.commands("create_atoms 1 single 0 0 0")
        assert np.isnan(fix_vector(session, "drive", 5))
        session.commands("pair_style none")
        assert np.isnan(fix_vector(session, "drive", 20))
