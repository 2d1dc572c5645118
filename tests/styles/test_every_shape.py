"""What every pair style must do, whatever its shape, in 2D and 3D: against its compiled class."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lammps_scenes import (
    after_restart,
    before_box,
    dump,
    error_of,
    fix_vector,
    global_vector,
    load_plugin,
    run_lmp,
    run_lmp_well,
)
from shape_scenes import (
    K_E,
    KINDS,
    Crowd,
    crowd_of,
    difference_from_class,
    found_by,
    frames_of,
    loaded,
    scene,
)

from jamshape import _contact

pytestmark = pytest.mark.lammps

# Relative to the largest force (torque) of the crowd.
TOLERANCE = 1e-13
CASES = [(shape, dimension) for shape in KINDS for dimension in (2, 3)]
EVERY_SHAPE = pytest.mark.parametrize(("shape", "dimension"), CASES)
COMPRESS = """
    fix move all overdamped/affine drag 1.0 compress {rate} {options}
    timestep {dt}"""


@EVERY_SHAPE
@pytest.mark.parametrize("newton", ["on", "off"])
def test_forces_energy_and_pressure_are_those_of_the_class(
    shape, dimension, newton, tmp_path, measured
):
    crowd = crowd_of(shape, dimension)
    expected = crowd.sums()
    with loaded(crowd, tmp_path, newton=newton) as session:
        session.commands(
            "compute packing all packing\nthermo_style custom step pe press c_packing[1]\n"
            "thermo_modify norm no\nrun 0"
        )
        found = found_by(session, crowd)
        energy, pressure = (session.lmp.get_thermo(name) for name in ("pe", "press"))
        phi = global_vector(session, "packing")[0]
    difference = difference_from_class(found)
    measured(difference=difference, bonds=expected["n_bonds"])
    assert expected["n_bonds"] > crowd.n
    assert difference < TOLERANCE
    volume = crowd.edges.prod()
    np.testing.assert_allclose(energy, expected["energy"], rtol=1e-13)
    np.testing.assert_allclose(
        pressure, np.trace(expected["virial"]) / (dimension * volume), rtol=1e-12
    )
    np.testing.assert_allclose(phi, crowd.compiled.measure.sum() / volume, rtol=1e-13)


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """Frames of every case, all from one process."""
    folder = tmp_path_factory.mktemp("ranks")
    cases = [(*case, newton) for case in CASES for newton in ("on", "off")]
    text = ""
    for shape, dimension, newton in cases:
        label = f"{shape}{dimension}{newton}"
        crowd = crowd_of(shape, dimension)
        text += f"""
            clear
            {load_plugin()}
            {scene(crowd, folder / f"{label}.data", newton=newton)}
            {dump(f"{label}.dump")}
            run 0"""
    run_lmp_well(text, folder, ranks=2)
    return {
        (shape, dimension, newton): frames_of(
            folder / f"{shape}{dimension}{newton}.dump", crowd_of(shape, dimension)
        )[0]
        for shape, dimension, newton in cases
    }


@EVERY_SHAPE
@pytest.mark.parametrize("newton", ["on", "off"])
def test_two_ranks_find_the_same_forces(shape, dimension, newton, on_two_ranks, measured):
    difference = difference_from_class(on_two_ranks[shape, dimension, newton])
    measured(difference=difference)
    assert difference < TOLERANCE


# --- computes ------------------------------------------------------------------------------------


def bonds_of(crowd):
    """Rows of itag jtag bond dist sumrad nx ny from the class, with the smaller ID first."""
    found = crowd.contacts()
    rows = []
    for c, (i, j) in enumerate(found["particles"] + 1):
        sign = 1 if i <= j else -1
        for b in range(found["n_bonds"][c]):
            values = [found[f"bond_{name}"][c, b] for name in ("distance", "reach")]
            normal = sign * found["bond_normal"][c, b, :2]
            rows.append([min(i, j), max(i, j), *values, *normal])
    return np.array(rows)


def sorted_rows(rows):
    return rows[np.lexsort(np.round(rows[:, ::-1].T, 9))]


@EVERY_SHAPE
def test_rows_of_contact_local_are_the_bonds(shape, dimension, tmp_path):
    crowd = crowd_of(shape, dimension)
    names = "itag jtag dist sumrad nx ny bond"
    with loaded(crowd, tmp_path) as session:
        session.commands(f"compute bonds all contact/local {names}\nrun 0")
        style_local, array = 2, 2
        rows = session.lmp.numpy.extract_compute("bonds", style_local, array).copy().reshape(-1, 7)
    np.testing.assert_allclose(
        sorted_rows(rows[:, :-1]), sorted_rows(bonds_of(crowd)), rtol=1e-10, atol=1e-12
    )
    assert set(rows[:, -1]) == set(range(crowd.contacts()["n_bonds"].max()))


def counted(crowd):
    """z, z_single and rattlers, by the rule of packing/rattlers.hpp."""
    found, D = crowd.contacts(), crowd.dimension
    kind = KINDS[crowd.shape].compiled
    contact, bond = np.nonzero(np.arange(kind.most_bonds) < found["n_bonds"][:, None])
    on_face = found["bond_on_face"]
    if not kind.bonds_are_contacts:
        contact, bond = np.arange(len(found["n_bonds"])), 0
        on_face = on_face.any(axis=1, keepdims=True)
    normals = np.zeros((len(contact), 3))
    normals[:, :D] = found["bond_normal"][contact, bond]
    pairs = found["particles"][contact]
    flat = np.ascontiguousarray(on_face[contact, bond])
    rattlers = _contact.find_rattlers(crowd.n, D, np.ascontiguousarray(pairs), normals, flat)
    held = ~rattlers[found["particles"]].any(axis=1)
    n_bonds = np.where((found["kind"] == 2) & (D == 2), 2, found["n_bonds"])
    backbone = max((~rattlers).sum(), 1)
    return 2 * n_bonds[held].sum() / backbone, 2 * held.sum() / backbone, rattlers.sum()


@EVERY_SHAPE
@pytest.mark.parametrize("spacing", [0.95, 1.2])
def test_contacts_and_rattlers_are_counted_as_in_python(shape, dimension, spacing, tmp_path):
    crowd = crowd_of(shape, dimension, spacing=spacing)
    with loaded(crowd, tmp_path) as session:
        session.commands("compute packing all packing\nthermo_style custom c_packing[4]\nrun 0")
        vector = global_vector(session, "packing")
    z, z_single, n_rattlers = counted(crowd)
    np.testing.assert_allclose(vector[[3, 8, 9]], [z, z_single, n_rattlers], rtol=1e-14)
    assert spacing == 0.95 or n_rattlers > 0
    if KINDS[shape].compiled.most_bonds == 1:
        assert z == z_single


@pytest.mark.parametrize(("p", "n_rattlers"), [(5.0, 0), (1.0, 2), (0.75, 2)])
@pytest.mark.parametrize("dimension", [2, 3])
def test_a_column_of_cubes_is_held_between_faces(dimension, p, n_rattlers, tmp_path):
    """Two particles on top of each other, and of their images: only faces hold them."""
    position = np.zeros((2, dimension))
    position[1, -1] = 1.97
    turn = np.zeros((2, 1)) if dimension == 2 else np.eye(4)[[0, 0]]
    edges = np.array([6.0] * (dimension - 1) + [3.94])
    crowd = Crowd("superellipsoid", position, turn, np.full((2, 3), 2.0), np.full(2, p), edges)
    with loaded(crowd, tmp_path) as session:
        session.commands("compute packing all packing\nthermo_style custom c_packing[10]\nrun 0")
        vector = global_vector(session, "packing")
    assert vector[9] == n_rattlers == counted(crowd)[2]
    assert vector[3] == (2.0 if n_rattlers == 0 else 0.0)


# --- motion --------------------------------------------------------------------------------------


@EVERY_SHAPE
@pytest.mark.parametrize("what", ["rotation pairs contact"])
def test_what_is_left_out_changes_nothing(shape, dimension, what, tmp_path):
    crowd = crowd_of(shape, dimension)
    ends = []
    for general in ("", f"general {what}"):
        path = tmp_path / f"{len(ends)}.dump"
        flow = COMPRESS.format(rate=1e-4, options="", dt=0.005)
        run_lmp_well(
            f"{load_plugin()}\n{scene(crowd, tmp_path / 's.data', general=general)}\n{dump(path, 50)}"
            f"\n{flow}\nrun 50",
            tmp_path,
        )
        ends.append(frames_of(path, crowd))
    (start, end), (start_there, end_there) = ends
    assert np.abs(start.force - start_there.force).max() < TOLERANCE * np.abs(start.force).max()
    assert np.abs(start.torque - start_there.torque).max() < TOLERANCE * np.abs(start.torque).max()
    assert np.abs(end.crowd.position - start.crowd.position).max() > 1e-4
    assert difference_from_class(end) < 1e-12
    np.testing.assert_allclose(end.crowd.position, end_there.crowd.position, atol=1e-11)
    np.testing.assert_allclose(end.crowd.orientation, end_there.crowd.orientation, atol=1e-11)


@EVERY_SHAPE
@pytest.mark.parametrize("integrator", ["heun", "heun/adaptive", "rkc2"])
def test_the_flow_relaxes_and_compresses(shape, dimension, integrator, tmp_path):
    """Without losing contacts; its estimates of rates go through the second derivatives."""
    crowd = crowd_of(shape, dimension)
    options = f"integrator {integrator}"
    dt = 0.002 if integrator == "heun" else 0.1
    steps = 200 if integrator == "heun" else 4
    with loaded(crowd, tmp_path) as session:
        session.commands("run 0")
        before = session.lmp.get_thermo("pe")
        session.commands(COMPRESS.format(rate=1e-4, options=options, dt=dt))
        session.commands(f"run {steps}")
        found = found_by(session, crowd)
        strain, rate = (fix_vector(session, "move", k) for k in (2, 3))
        energy = session.lmp.get_thermo("pe")
    assert difference_from_class(found) < 1e-12
    assert energy < 0.9 * before
    np.testing.assert_allclose(strain, 1e-4 * dt * steps, rtol=1e-12)
    assert rate > 0


@EVERY_SHAPE
def test_restart_goes_on_as_if_never_stopped(shape, dimension, tmp_path):
    crowd = crowd_of(shape, dimension)
    flow = COMPRESS.format(rate=1e-3, options="", dt=0.004)
    restart, data = tmp_path / "half.restart", tmp_path / "s.data"
    run_lmp_well(
        f"""{load_plugin()}
        {scene(crowd, data)}
        {flow}
        {dump(tmp_path / "whole.dump", every=60)}
        restart 60 {restart} {tmp_path / "end.restart"}
        run 120""",
        tmp_path,
    )
    run_lmp_well(
        f"""{load_plugin()}
        read_restart {restart}
        {after_restart()}
        {flow}
        {dump(tmp_path / "half.dump", every=60)}
        run 60""",
        tmp_path, ranks=2,
    )  # fmt: skip
    _, middle, end = frames_of(tmp_path / "whole.dump", crowd)
    again, found = frames_of(tmp_path / "half.dump", crowd)
    for there, here in ((again, middle), (found, end)):
        np.testing.assert_allclose(there.crowd.position, here.crowd.position, atol=1e-13)
        np.testing.assert_allclose(there.crowd.orientation, here.crowd.orientation, atol=1e-13)
        assert np.array_equal(there.crowd.edges, here.crowd.edges)


@EVERY_SHAPE
@pytest.mark.parametrize("style", ["cg", "sd"])
def test_minimisers_relax_positions_and_orientations(shape, dimension, style, tmp_path, measured):
    crowd = crowd_of(shape, dimension)
    with loaded(crowd, tmp_path) as session:
        session.commands("run 0")
        before = session.lmp.get_thermo("pe")
        session.commands(f"""
            min_style {style}
            min_modify dmax 0.05
            minimize 0.0 0.0 300 6000
            run 0""")
        energy, found = session.lmp.get_thermo("pe"), found_by(session, crowd)
    measured(energy=energy / before)
    assert energy < 0.6 * before
    expected = found.crowd.sums()
    np.testing.assert_allclose(energy, expected["energy"], rtol=1e-11, atol=1e-16 * K_E)
    assert np.abs(found.crowd.orientation - crowd.orientation).max() > 1e-3


# --- what is refused -----------------------------------------------------------------------------


@EVERY_SHAPE
def test_coinciding_particles_stop_the_run(shape, dimension, tmp_path):
    crowd = crowd_of(shape, dimension)
    position, turn = crowd.position.copy(), crowd.orientation.copy()
    position[1], turn[1] = position[0], turn[0]
    diameters = crowd.diameters.copy()
    diameters[1] = diameters[0]
    doubled = replace(crowd, position=position, orientation=turn, diameters=diameters)
    text = f"{load_plugin()}\n{scene(doubled, tmp_path / 's.data')}\nrun 0"
    sentence = error_of(run_lmp(text, tmp_path))
    assert f"pair_style {shape}/harmonic found atoms" in sentence
    assert "where no contact force exists: start from a state without overlap" in sentence


@pytest.mark.parametrize("shape", ["spherocylinder", "dimer"])
def test_other_shapes_are_refused(shape, tmp_path):
    text = scene(crowd_of(shape, 2), tmp_path / "s.data")
    wrong = "set atom 7 shape 1.0 2.0 3.0\nrun 0"
    sentence = error_of(run_lmp(f"{load_plugin()}\n{text}\n{wrong}", tmp_path))
    assert sentence.startswith(
        f"{shape}/harmonic found atom 7 with diameters 1 2 3, expected that a {shape} has diameters"
    )


@pytest.mark.parametrize("words", ["p 1.5", "general", "general turns"])
def test_words_that_no_dimer_style_knows(words, tmp_path):
    text = f"{load_plugin()}\n{before_box(2)}\nregion b block 0 9 0 9 -0.5 0.5\ncreate_box 1 b"
    sentence = error_of(run_lmp(f"{text}\npair_style dimer/harmonic {words}", tmp_path))
    assert sentence.startswith(f"pair_style dimer/harmonic found '{words}', expected ")
