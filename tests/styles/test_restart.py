"""write_restart and read_restart of the pair style and of fix overdamped/affine."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_scenes import (
    after_restart,
    angle_between,
    dense,
    dump,
    error_of,
    fix_vector,
    load_plugin,
    loaded,
    pose_differences,
    restarted,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)

pytestmark = pytest.mark.lammps

KAPPA, DT, STEPS = 1.3e-3, 0.07, 150

# The first number of the fix in restart files, which tells formats apart.
FORMAT = 0x6A616D7368617003


def fix(kappa=KAPPA, dt=DT, options=""):
    return f"""
        fix drive all overdamped/affine drag 1.3 compress {kappa} {options}
        timestep {dt}"""


@pytest.fixture(scope="module")
def packings():
    """In all three, particles of two types with k_e of their own, and cross terms mixed."""
    return {
        "rods": dense(n=32, phi=0.9),
        "rods 3d": dense(3, alpha=2.0, n=32, phi=0.7),
        "discs": dense(alpha=0.0, n=32, phi=0.9),
    }


PRINT_STRAIN = """
    variable strain equal f_drive[2]
    print 'strain $(v_strain:%.17g)'"""


def strain_in(output):
    return output.split("strain ")[-1].split()[0]


COEFFICIENTS = "pair_coeff 1 1 1.0\npair_coeff 2 2 1.7\npair_coeff 1 2 1.25"


def uninterrupted(packing, folder, ranks, sides, options):
    out = run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, folder / "start.data", sides=sides)}
        {COEFFICIENTS}
        {fix(options=options, dt=0.03)}
        run 40
        timestep {DT}
        {dump(folder / "whole.dump", every=STEPS)}
        restart {STEPS} {folder / "half.restart"} {folder / "end.restart"}
        run {2 * STEPS} upto
        {PRINT_STRAIN}""",
        folder,
        ranks,
    )
    return states_from_dump(folder / "whole.dump"), strain_in(out)


def second_half(folder, ranks, text=""):
    """In a new process; the pair style and its coefficients come from the file."""
    out = run_lmp_well(
        f"""{load_plugin()}
        read_restart {folder / "half.restart"}
        {after_restart()}
        {text}
        {dump(folder / "half.dump", every=STEPS)}
        run {STEPS}
        {PRINT_STRAIN}""",
        folder,
        ranks,
    )
    return states_from_dump(folder / "half.dump"), strain_in(out)


@pytest.mark.parametrize(
    ("name", "sides", "ranks_before", "ranks_after", "options"),
    [
        ("rods", "two", 1, 1, ""),
        ("rods", "two", 2, 2, "reference corner"),
        ("rods", "two", 1, 2, ""),
        ("rods", "two", 2, 1, ""),
        ("rods", "one", 1, 1, ""),
        ("rods 3d", "two", 1, 2, ""),
        ("discs", "one", 2, 1, ""),
    ],
)
def test_restart_goes_on_as_if_never_stopped(
    name, sides, ranks_before, ranks_after, options, packings, tmp_path, measured
):
    (middle, expected), strain = uninterrupted(
        packings[name], tmp_path, ranks_before, sides, options
    )
    (again, found), strain_found = second_half(tmp_path, ranks_after, fix(options=options))
    assert strain_found == strain
    for other, whole in ((again, middle), (found, expected)):
        assert other.packing.step == whole.packing.step
        np.testing.assert_array_equal(other.packing.box.edges, whole.packing.box.edges)
        np.testing.assert_array_equal(other.packing.box.lo, whole.packing.box.lo)
    np.testing.assert_array_equal(again.quaternion, middle.quaternion)
    assert pose_differences(again, middle)[0] < 1e-15
    assert np.abs(unwrapped(expected) - unwrapped(middle)).max() > 1e-3
    distance = np.abs(unwrapped(found) - unwrapped(expected)).max() / found.packing.box.edges[0]
    angle = angle_between(found.quaternion, expected.quaternion).max()
    measured(distance=distance, angle=angle)
    assert distance < 1e-13
    assert angle < 1e-13


def unwrapped(state):
    packing = state.packing
    return packing.position + packing.image * packing.box.edges


# --- what the fix takes from the file, and what from its command ----------------------------------


@pytest.fixture
def halfway(packings, tmp_path):
    """State at half time, and the path of the restart file written there."""
    with loaded(packings["rods"], tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun {STEPS}\nwrite_restart {tmp_path / 'half.restart'}")
        return state_of(session), tmp_path / "half.restart"


def strain_of(box, start):
    return -np.log(box.edges / start.edges)


@pytest.mark.parametrize(("kappa", "dt"), [(-2.7e-3, DT), (KAPPA, 0.011), (0.0, 0.03)])
def test_new_rate_or_time_step_goes_on_from_the_present_strain(kappa, dt, halfway, packings):
    state, path = halfway
    with restarted(path, after_restart() + fix(kappa, dt)) as session:
        session.commands("run 0")
        assert fix_vector(session, "drive", 2) == pytest.approx(KAPPA * DT * STEPS, rel=1e-15)
        np.testing.assert_array_equal(state_of(session).packing.box.edges, state.packing.box.edges)
        session.commands("run 100")
        strain = KAPPA * DT * STEPS + kappa * dt * 100
        assert fix_vector(session, "drive", 2) == pytest.approx(strain, rel=1e-14)
        box = state_of(session).packing.box
    np.testing.assert_allclose(strain_of(box, packings["rods"].box), strain, rtol=1e-13)


def test_time_step_may_change_between_runs(packings, tmp_path):
    with loaded(packings["rods"], tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 40\ntimestep 0.01\nrun 60\nrun 10\ntimestep {DT}\nrun 5")
        strain = KAPPA * (45 * DT + 70 * 0.01)
        assert fix_vector(session, "drive", 2) == pytest.approx(strain, rel=1e-14)
        box = state_of(session).packing.box
    np.testing.assert_allclose(strain_of(box, packings["rods"].box), strain, rtol=1e-13)


@pytest.mark.parametrize("after_a_restart", [False, True])
def test_new_fix_starts_anew(after_a_restart, halfway, packings, tmp_path):
    state, path = halfway
    if after_a_restart:  # a fix of another name leaves the stored state alone
        instance = restarted(path, after_restart() + fix().replace("fix drive", "fix other"))
        name = "other"
    else:
        instance = loaded(packings["rods"], tmp_path, sides="two")
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
def test_state_that_something_else_changed_is_taken_as_it_is(change, packings, tmp_path):
    """The fix keeps coordinates of its own; they follow what other commands do between runs."""
    with loaded(packings["rods"], tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 50\n{change}\nunfix drive\nrun 0")
        changed = state_of(session)
    with loaded(packings["rods"], tmp_path, sides="two") as session:
        session.commands(f"{fix()}\nrun 50\n{change}\nrun 0")
        seen = state_of(session)
        session.commands("run 1")
        after = state_of(session)
    np.testing.assert_array_equal(seen.packing.position, changed.packing.position)
    np.testing.assert_array_equal(seen.packing.box.edges, changed.packing.box.edges)
    assert pose_differences(after, changed)[0] < 1e-3


def test_a_restart_file_of_another_version_is_refused(packings, tmp_path):
    path, mark = tmp_path / "half.restart", FORMAT.to_bytes(8, "little")
    with loaded(packings["rods"], tmp_path) as session:
        session.commands(f"{fix()}\nrun 1\nwrite_restart {path}")
    content = path.read_bytes()
    assert content.count(mark) == 1
    path.write_bytes(content.replace(mark, bytes(8)))
    done = run_lmp(f"{load_plugin()}\nread_restart {path}\n{after_restart()}\n{fix()}", tmp_path)
    assert "found a restart file of another version of jamshape" in error_of(done)


def test_a_restart_file_without_the_time_is_read(packings, tmp_path):
    """As written before the fix counted time across changes of the time step."""
    path, mark = tmp_path / "half.restart", FORMAT.to_bytes(8, "little")
    with loaded(packings["rods"], tmp_path) as session:
        session.commands(f"{fix()}\nrun 10\nwrite_restart {path}")
    path.write_bytes(path.read_bytes().replace(mark, (FORMAT - 1).to_bytes(8, "little")))
    with restarted(path, after_restart() + fix()) as session:
        session.commands("run 5")
        assert fix_vector(session, "drive", 1) == pytest.approx(15 * DT, rel=1e-14)
        assert fix_vector(session, "drive", 2) == pytest.approx(15 * DT * KAPPA, rel=1e-14)


def test_minimisation_leaves_strain_and_time_where_they_were(packings, tmp_path):
    """LAMMPS counts its iterations as steps; a restart file written after it knows, too."""
    path = tmp_path / "after.restart"
    with loaded(packings["rods"], tmp_path, sides="two") as session:
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
    np.testing.assert_allclose(
        strain_of(box, packings["rods"].box), KAPPA * (20 * DT + 0.2), rtol=1e-12
    )
    with restarted(path, after_restart() + fix(dt=0.02)) as session:
        session.commands("run 10")
        assert session.step == step
        np.testing.assert_array_equal(state_of(session).packing.box.edges, box.edges)
        assert fix_vector(session, "drive", 1) == pytest.approx(20 * DT + 10 * 0.02, rel=1e-14)


def test_numbers_of_forces_before_a_run_are_not_there(packings, tmp_path):
    """Neither before the first run nor after another pair style or particles have come."""
    with loaded(packings["rods"], tmp_path, sides="two") as session:
        session.commands(fix())
        asked = {k: fix_vector(session, "drive", k) for k in range(1, 21)}
        assert {k for k, value in asked.items() if np.isnan(value)} == {5, 20}
        session.commands("run 1")
        assert fix_vector(session, "drive", 5) > 0
        session.commands("create_atoms 1 single 0 0 0")
        assert np.isnan(fix_vector(session, "drive", 5))
        session.commands("pair_style none")
        assert np.isnan(fix_vector(session, "drive", 20))
