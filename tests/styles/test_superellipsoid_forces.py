"""superellipsoid/harmonic: forces, torques, energy and pressure against the bindings."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from lammps_scenes import (
    before_box,
    dump,
    global_vector,
    gradient_by_differences,
    load_plugin,
    moved,
    run_lmp_well,
    states_from_dump,
    with_odd_ids,
)
from superellipsoid_scenes import (
    EPSILON,
    after_restart,
    crowd,
    difference_from_bindings,
    exponents_of,
    loaded,
    pair_commands,
    particles,
    state_of,
    sums,
    tiny_box,
)

from jamshape.files.lammps_text import write_data
from jamshape.measures.order3d import cubatic_order, nematic_order
from jamshape.packing import body_axes

pytestmark = pytest.mark.lammps

# Relative to the largest force (torque) of the packing.
TOLERANCE = 1e-13

SCENES = {
    "mixture": crowd,
    "p 0.75": lambda: crowd(kinds=(0,)),
    "p 1": lambda: crowd(kinds=(1,)),
    "p 1.5": lambda: crowd(kinds=(2,)),
    "p 2": lambda: crowd(kinds=(3,)),
    "odd ids": lambda: with_odd_ids(crowd(), 5),
    "shifted": lambda: moved(crowd(), [0.5, 0.25, 0.75]),
    "tiny box": tiny_box,
    "spheres": lambda: particles(crowd().position, [1.0, 0, 0, 0], 0.6, 1.0, crowd().box.edges),
    "plane": lambda: crowd(2, phi=0.95),
    "plane p 2": lambda: crowd(2, kinds=(3,), phi=0.95),
    "plane tiny box": lambda: tiny_box(2),
}
CASES = [(name, newton) for name in SCENES for newton in ("on", "off")]

THERMO = """
    compute packing all packing
    thermo_style custom step pe press c_packing[1]
    thermo_modify norm no format float %.17g"""


@functools.cache
def packing_of(name):
    return SCENES[name]()


def assert_state_and_thermo(name, state, pe, press, phi, measured):
    expected = sums(packing_of(name))
    difference = difference_from_bindings(state)
    measured(difference=difference, bonds=expected["n_bonds"])
    assert expected["n_bonds"] > 3
    assert difference < TOLERANCE
    box = state.packing.box
    pressure = np.trace(expected["virial"]) / (box.dimension * box.volume)
    np.testing.assert_allclose(pe, expected["energy"], rtol=1e-13)
    np.testing.assert_allclose(press, pressure, rtol=1e-13)
    np.testing.assert_allclose(phi, packing_of(name).phi, rtol=1e-13)


@pytest.mark.parametrize(("name", "newton"), CASES)
def test_forces_equal_the_bindings(name, newton, tmp_path, measured):
    packing = packing_of(name)
    with loaded(packing, tmp_path, newton=newton) as session:
        session.commands(f"{THERMO}\nrun 0")
        state = state_of(session, packing)
        pe, press = (session.lmp.get_thermo(key) for key in ("pe", "press"))
        phi = global_vector(session, "packing")[0]
    assert_state_and_thermo(name, state, pe, press, phi, measured)


def one_scene(case, folder):
    name, newton = case
    label = "-".join(case).replace(" ", "_")
    write_data(folder / f"{label}.data", packing_of(name))
    return f"""
        clear
        {load_plugin()}
        {before_box(packing_of(name).dimension, newton)}
        read_data {label}.data
        {pair_commands(packing_of(name))}
        {after_restart()}
        {THERMO}
        {dump(f"{label}.dump")}
        run 0
        print "{label} $(pe:%.17g) $(press:%.17g) $(c_packing[1]:%.17g) &
            $(c_packing[5]:%.17g) $(c_packing[14]:%.17g)" append thermo"""


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """State and thermo output of every case: all in one process."""
    folder = tmp_path_factory.mktemp("ranks")
    run_lmp_well("".join(one_scene(case, folder) for case in CASES), folder, ranks=2)
    rows = [line.split() for line in (folder / "thermo").read_text().splitlines()]
    thermo = {label: [float(number) for number in numbers] for label, *numbers in rows}
    found = {}
    for case in CASES:
        label = "-".join(case).replace(" ", "_")
        (state,) = states_from_dump(folder / f"{label}.dump", exponents_of(packing_of(case[0])))
        found[case] = state, thermo[label]
    return found


@pytest.mark.parametrize("case", CASES, ids="-".join)
def test_forces_on_two_ranks_equal_the_bindings(case, on_two_ranks, measured):
    state, (pe, press, phi, *_) = on_two_ranks[case]
    assert_state_and_thermo(case[0], state, pe, press, phi, measured)


def test_forces_do_not_depend_on_ids_or_origin(on_two_ranks):
    expected = on_two_ranks["mixture", "on"][0]
    for name in ("odd ids", "shifted"):
        state = on_two_ranks[name, "on"][0]
        rank = np.argsort(np.argsort(packing_of(name).id))  # rows of the state in the packing's
        for found, wanted in ((state.force, expected.force), (state.torque, expected.torque)):
            assert np.abs(found[rank] - wanted).max() < TOLERANCE * np.abs(wanted).max()


def test_spheres_have_no_torque_and_the_law_of_yuan(tmp_path):
    """U = eps/2 ((r/d)^2 - 1)^2."""
    packing = particles([[0, 0, 0], [0.7, 0.3, 0.1]], [1.0, 0, 0, 0], [[0.5] * 3, [0.4] * 3], 1.0,
                        [9.0] * 3)  # fmt: skip
    with loaded(packing, tmp_path) as session:
        session.commands("run 0")
        energy, state = session.lmp.get_thermo("pe"), state_of(session, packing)
    x = 0.59 / 0.9**2
    np.testing.assert_allclose(energy, 0.5 * EPSILON * (1 - x) ** 2, rtol=1e-14)
    force = 2 * EPSILON * (1 - x) / 0.9**2 * np.array([-0.7, -0.3, -0.1])
    np.testing.assert_allclose(state.force[0], force, rtol=1e-14)
    assert not state.torque.any()


@pytest.mark.parametrize("name", ["mixture", "p 0.75", "p 2", "plane"])
def test_forces_are_the_gradient_of_the_energy(name, tmp_path, measured):
    packing = packing_of(name)
    with loaded(packing, tmp_path, extra="atom_modify sort 0 0.0") as session:
        session.commands("run 0")
        state = state_of(session, packing)
        by_position, by_rotation = gradient_by_differences(session, state, 1e-6)
    of_force = np.abs(by_position + state.force).max() / np.abs(state.force).max()
    of_torque = np.abs(by_rotation + state.torque).max() / np.abs(state.torque).max()
    measured(force=of_force, torque=of_torque)
    assert of_force < 1e-7
    assert of_torque < 1e-7


@pytest.mark.parametrize("name", ["mixture", "plane"])
def test_pressure_is_minus_dU_dV_and_the_sum_over_scales(name, tmp_path, measured):
    packing = packing_of(name)
    D, step = packing.dimension, 1e-6
    with loaded(packing, tmp_path) as session:
        session.commands("compute bonds all contact/local dist sumrad\nrun 0")
        style_local, array = 2, 2
        bonds = session.lmp.numpy.extract_compute("bonds", style_local, array).copy()
        pressure = session.lmp.get_thermo("press")

        def energy_at(factor):
            half = factor * packing.box.edges / 2
            bounds = " ".join(
                f"{x} final {-h:.17g} {h:.17g}" for x, h in zip("xyz"[:D], half, strict=True)
            )
            session.commands(f"change_box all {bounds} remap units box\nrun 0")
            return session.lmp.get_thermo("pe")

        rise = energy_at(1 + step) - energy_at(1 - step)
    x = bonds[:, 0] / bonds[:, 1]
    np.testing.assert_allclose(
        pressure * packing.box.volume, 2 / D * EPSILON * (x * (1 - x)).sum(), rtol=1e-13
    )
    volume_change = packing.box.volume * ((1 + step) ** D - (1 - step) ** D)
    measured(relative=-rise / volume_change / pressure - 1)
    np.testing.assert_allclose(-rise / volume_change, pressure, rtol=1e-8)


def test_unlike_types_mix_their_epsilon_unless_told(tmp_path):
    packing = particles([[0, 0, 0], [0.9, 0.2, 0.1]], [[1.0, 0, 0, 0], [1.0, 0.2, 0.3, 0.1]],
                        [0.5, 0.6, 0.7], [1.0, 1.5], [9.0] * 3)  # fmt: skip
    energy = []
    with loaded(packing, tmp_path) as session:
        for lines in ("pair_coeff * * 1.0",
                      "pair_coeff 1 1 2.0\npair_coeff 2 2 8.0\npair_coeff 1 2 4.0"):  # fmt: skip
            session.commands(f"{lines}\nrun 0")
            energy.append(session.lmp.get_thermo("pe"))
    assert energy[0] > 0
    np.testing.assert_allclose(energy[1], 4 * energy[0], rtol=1e-15)
    np.testing.assert_allclose(energy[0], sums(packing, 1.0)["energy"], rtol=1e-13)


def director_axis(diameters):
    """The longest axis where a c > b^2, else the shortest (Yuan et al. 2019, Sec. 2.4)."""
    a, b, c = np.sort(diameters, axis=1).T
    is_long = a * c > (1 + 1e-9) * b**2
    return np.where(is_long, diameters.argmax(axis=1), diameters.argmin(axis=1))


def orders_of(packing):
    """S_2 and C_4."""
    axes = body_axes(packing.orientation)
    nematic = nematic_order(axes[np.arange(packing.n), director_axis(packing.diameters)])
    return nematic.magnitude, cubatic_order(axes).magnitude


@pytest.mark.parametrize("kinds", [(0,), (1,), (2,), (3,)])
@pytest.mark.parametrize("is_aligned", [True, False])
def test_order_is_that_of_the_library(kinds, is_aligned, tmp_path):
    packing = crowd(kinds=kinds, spread=0.0)
    if is_aligned:
        noise = 0.1 * np.random.default_rng(1).normal(size=(packing.n, 4))
        turn = np.array([1.0, 0.3, -0.2, 0.5]) + noise
        packing = packing.with_(orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True))
    with loaded(packing, tmp_path) as session:
        session.commands(f"{THERMO}\nrun 0")
        values = global_vector(session, "packing")
    np.testing.assert_allclose((values[4], values[13]), orders_of(packing), rtol=1e-12)
    assert values[10] == sums(packing)["n_bonds"]


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("name", ["p 0.75", "p 1", "p 1.5", "p 2"])
def test_order_on_two_ranks_is_that_of_the_library(name, newton, on_two_ranks):
    _, (*_, S_2, C_4) = on_two_ranks[name, newton]
    np.testing.assert_allclose((S_2, C_4), orders_of(packing_of(name)), rtol=1e-12)
