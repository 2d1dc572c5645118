"""The pair style of every shape in LAMMPS: the library's forces, contacts and measures, on one and two ranks."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from chosen_seeds import chosen_with_avx512
from every_shape import MIXTURES, TYPICAL, size_of
from lammps_runs import (
    BONDS,
    difference_from,
    dump,
    load_plugin,
    loaded,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)
from lammps_scenes import gradient_by_differences, pose_differences
from once import made_once
from pair_scenes import RODS, SCENES, SUPERELLIPSOIDS, limit_of, packing_of

from jamshape.contacts import (
    ContactKind,
    coordination,
    find_contacts,
    find_rattlers,
    forces,
    sum_forces,
)
from jamshape.lammps.session import Session
from jamshape.measures.order import order, planar_order

pytestmark = pytest.mark.lammps

K_E = 1.7
NAMES = {1: "one", 2: "two"}
THERMO = ["pe", "press", "pxx", "pyy", "pxy", *(f"c_packing[{k}]" for k in range(1, 23))]


class Case(NamedTuple):
    """A scene with the number of bonds of a flat contact, and how LAMMPS runs."""

    name: str
    sides: int
    newton: str
    ranks: int

    def __str__(self):
        return f"{self.name}-{NAMES[self.sides]}-{self.newton}-{self.ranks}"


class Found(NamedTuple):
    """All that LAMMPS says of a scene."""

    state: object
    thermo: dict[str, float]
    rows: np.ndarray


ONCE = ("-barely", "-loose")


def sides_of(name):
    """Both laws of rods; of other shapes, and of what is measured once, there is one."""
    is_rods = name in RODS or name.startswith(("spherocylinder", "jammed"))
    return (1, 2) if is_rods and not name.endswith(ONCE) else (2,)


def newton_of(name, ranks=1):
    if name.endswith(ONCE) or name.startswith("extreme"):
        return ("on",)
    if name.startswith("jammed"):
        return ({1: "on", 2: "off"}[ranks],)
    return ("on", "off")


# In a process of its own, where each scene takes a while to start.
ON_TWO_RANKS = [
    *(f"{case}{end}" for case in MIXTURES for end in ("", "-small")),
    *RODS, *SUPERELLIPSOIDS, *(name for name in SCENES if name.startswith(("extreme", "jammed"))),
]  # fmt: skip
CASES = [
    Case(name, sides, newton, ranks)
    for ranks, names in ((1, SCENES), (2, ON_TWO_RANKS))
    for name in names
    for sides in sides_of(name)
    for newton in newton_of(name, ranks)
]
# A bond of a weight that is rounding to the fifth power, 1e-80, counts in one program and not in the other.
CHOSEN = "spheropolygon-2D-mixture-barely"
IN_TURN = {name: ("on", "off")[k % 2] for k, name in enumerate(SCENES)}


# On two ranks: a way of moving bodies between ranks or of exchanging forces that no other one has.
QUICK_ON_TWO = {
    *(f"{case}{end}" for case in MIXTURES for end in ("", "-small")),
    "rods", "mixture", "odd ids", "tiny box", "rods 3d", "mixture 3d", "tiny box 3d",
    "bodies", "bodies, odd ids", "bodies, tiny box", "spheres of sizes", "plane", "plane tiny box",
}  # fmt: skip


def marked(case):
    """The case; of scenes with both settings of newton the default suite has one on one rank, the other one on two."""
    has_both = len(newton_of(case.name, case.ranks)) == 2
    is_quick = not has_both or (case.newton == IN_TURN[case.name]) == (case.ranks == 1)
    is_quick &= case.ranks == 1 or case.name in QUICK_ON_TWO
    return pytest.param(case, marks=() if is_quick else pytest.mark.validate)


EVERY = pytest.mark.parametrize("case", [marked(case) for case in CASES], ids=str)


def text_of(case, folder, label):
    """Input for a scene, to the forces of its start."""
    file = folder / label
    numbers = " ".join(f"$({name}:%.17g)" for name in THERMO)
    return f"""
        {
        scene(
            packing_of(case.name),
            file.with_suffix(".data"),
            newton=case.newton,
            k_e=K_E,
            sides=NAMES[case.sides],
        )
    }
        compute packing all packing
        compute bonds all contact/local {" ".join(BONDS)}
        dump bonds all local 1 {file}.bonds c_bonds[*]
        dump_modify bonds format float %.17g
        {dump(f"{file}.dump")}
        thermo_style custom step pe press pxx pyy pxy c_packing[1]
        thermo_modify norm no
        run 0
        print "{numbers}" file {file}.thermo screen no"""


def read(case, folder, label):
    (state,) = states_from_dump(folder / f"{label}.dump", packing_of(case.name))
    numbers = np.loadtxt(folder / f"{label}.thermo")
    rows = (folder / f"{label}.bonds").read_text().splitlines()[9:]
    table = np.array([row.split() for row in rows], float).reshape(-1, len(BONDS))
    return Found(state, dict(zip(THERMO, numbers, strict=True)), table)


@pytest.fixture(scope="module")
def found_in(tmp_path_factory, request):
    """What LAMMPS says of a case; those on two ranks run one after another in one process, once for all workers of pytest."""
    folder = tmp_path_factory.mktemp("found")
    params = (getattr(item, "callspec", None) for item in request.session.items)
    asked = [spec.params.get("case") for spec in params if spec]
    on_two = [case for case in CASES if case.ranks == 2 and case in asked]

    @cache
    def on_two_ranks():
        # Two at once would have more ranks than there are cores.
        return made_once(tmp_path_factory, "pair_styles_on_two_ranks", run_on_two_ranks)

    def run_on_two_ranks(folder):
        texts = (text_of(case, folder, f"two{k}") for k, case in enumerate(on_two))
        run_lmp_well("\n".join(f"clear\n{load_plugin()}\n{text}" for text in texts), folder, 2)

    @cache
    def found(case):
        if case.ranks == 2:
            return read(case, on_two_ranks(), f"two{on_two.index(case)}")
        with Session() as session:
            session.commands(text_of(case, folder, "one"))
        return read(case, folder, "one")

    return found


@cache
def network_of(name, sides):
    return find_contacts(packing_of(name), K_E, sides)


# --- forces --------------------------------------------------------------------------------------


@EVERY
def test_forces_are_those_of_the_library(case, found_in, measured):
    packing, (state, thermo, _) = packing_of(case.name), found_in(case)
    network = find_contacts(state.packing, K_E, case.sides)
    limit = limit_of(case.name, network)
    difference = difference_from(network, state, SCENES[case.name].least_torque)
    measured(difference=difference, bonds=network.n_bonds.sum())
    assert network.n_bonds.sum() > 1
    assert difference <= limit
    expected = sum_forces(state.packing, network)
    volume = packing.box.volume
    assert expected.energy > 0
    for name, value in {
        "pe": expected.energy, "press": expected.pressure, "c_packing[1]": packing.phi,
        "c_packing[2]": expected.energy / volume, "c_packing[3]": expected.pressure,
    }.items():  # fmt: skip
        np.testing.assert_allclose(thermo[name], value, rtol=limit, err_msg=name)
    stress = [thermo["pxx"], thermo["pyy"], thermo["pxy"]]
    virial = expected.virial / volume
    wanted = [virial[0, 0], virial[1, 1], virial[1, 0]]  # of y along x, the derivative by the tilt
    np.testing.assert_allclose(stress, wanted, rtol=0, atol=limit * np.abs(virial).max())


@pytest.mark.parametrize("name", SCENES)
def test_lammps_holds_the_packing_that_was_written(name, found_in):
    """Its poses to rounding, and with them the energy."""
    packing = packing_of(name).sorted_by_id()
    found = found_in(Case(name, 2, "on", 1)).state.packing
    np.testing.assert_array_equal(found.id, packing.id)
    inside = packing.box.wrapped(packing.position)[0] - packing.box.wrapped(found.position)[0]
    away = inside - packing.box.edges * np.round(inside / packing.box.edges)
    assert np.abs(away / packing.box.edges).max() < 1e-14
    np.testing.assert_allclose(found.body_axes(0), packing.body_axes(0), rtol=0, atol=1e-15)
    np.testing.assert_array_equal(found.diameters, packing.diameters)
    energy = forces(packing, K_E, 2).energy
    limit = limit_of(name, network_of(name, 2))
    np.testing.assert_allclose(forces(found, K_E, 2).energy, energy, rtol=100 * limit)


def test_scenes_hold_what_they_stand_for():
    assert set(network_of("rods", 2).kind) == {0, 1, 2}
    assert set(network_of("lone rod", 2).kind) == {0, 2}
    for name in ("tiny box", "tiny box 3d"):
        i, j = network_of(name, 1).pairs.T
        assert (i == j).any(), "own image in reach"
        assert ((i == 0) & (j == 1)).sum() > 1, "several images of the neighbour in reach"
    bonds = network_of("extreme, overlap of a third", 2).bonds
    np.testing.assert_allclose(1 - bonds.distance / bonds.reach, 1 / 3, rtol=1e-9)
    pairs = network_of("extreme, own images", 2).pairs
    assert (pairs[:, 0] == pairs[:, 1]).any()
    for name in ("cubes face to face", "octahedra tip to tip", "nearly concentric"):
        network = network_of(f"extreme, {name}", 2)
        assert network.n_bonds.sum() == packing_of(f"extreme, {name}").n / 2
    for name in SCENES:
        least = 1 if name == "lone rod" else 3
        assert len(network_of(name, 2).pairs) > least - 1, name
    assert 0 < rattlers_of("jammed, 2D, alpha 0.02") < 40
    for case in TYPICAL:
        assert 2 <= rattlers_of(f"{case}-loose") < packing_of(str(case)).n, case


def rattlers_of(name):
    return find_rattlers(packing_of(name), network_of(name, 2)).sum()


@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize(
    ("name", "others", "rounding"),
    [("rods", ("odd ids", "shifted"), 1e-14),
     ("bodies", ("bodies, odd ids", "bodies, shifted"), 1e-13)],
)  # fmt: skip
def test_forces_do_not_depend_on_ids_or_origin(name, others, rounding, sides, found_in):
    if sides not in sides_of(name):
        pytest.skip("the shape has one law")

    def in_the_order_of_the_packing(scene):
        state = found_in(Case(scene, sides, "on", 1)).state
        rank = np.argsort(np.argsort(packing_of(scene).id))
        return state.force[rank], state.torque[rank]

    expected = in_the_order_of_the_packing(name)
    for other in others:
        for found, wanted in zip(in_the_order_of_the_packing(other), expected, strict=True):
            assert np.abs(found - wanted).max() <= rounding * np.abs(wanted).max()


# --- derivatives of the energy -------------------------------------------------------------------

SMOOTH = [
    *(pytest.param(str(case), 2, id=str(case)) for case in TYPICAL),
    # Those of one exponent are among the bodies of all.
    *(pytest.param(name, s, id=f"{name}-{NAMES[s]}", marks=pytest.mark.validate if name.startswith("p ") else ())
      for name in ("rods", "mixture", "rods 3d", "bodies", "p 0.75", "p 2", "plane")
      for s in sides_of(name)),
]  # fmt: skip


@pytest.mark.parametrize(("name", "sides"), SMOOTH)
def test_forces_are_the_gradient_of_the_energy(name, sides, tmp_path, measured):
    packing = packing_of(name)
    sort = "atom_modify sort 0 0.0"
    with loaded(packing, tmp_path, sides=NAMES[sides], k_e=K_E, extra=sort) as session:
        session.commands("run 0")
        state = state_of(session, packing)
        by_position, by_rotation = gradient_by_differences(session, state, 1e-6)
        assert max(pose_differences(state_of(session, packing), state)) < 1e-14
    of_force = np.abs(by_position + state.force).max() / np.abs(state.force).max()
    of_torque = np.abs(by_rotation + state.torque).max() / np.abs(state.torque).max()
    measured(force=of_force, torque=of_torque)
    assert of_force < 1e-7
    assert of_torque < 1e-7


@pytest.mark.parametrize(("name", "sides"), SMOOTH)
def test_pressure_is_minus_dU_dV(name, sides, tmp_path, measured):
    packing = packing_of(name)
    D, step = packing.dimension, 1e-6
    lo, edges = packing.box.lo, packing.box.edges
    with loaded(packing, tmp_path, sides=NAMES[sides], k_e=K_E) as session:
        session.commands("run 0")
        pressure = session.lmp.get_thermo("press")

        def energy_at(factor):
            bounds = " ".join(
                f"{x} final {factor * at:.17g} {factor * (at + edge):.17g}"
                for x, at, edge in zip("xyz"[:D], lo, edges, strict=True)
            )
            session.commands(f"change_box all {bounds} remap units box\nrun 0")
            return session.lmp.get_thermo("pe")

        rise = energy_at(1 + step) - energy_at(1 - step)
    volume_change = packing.box.volume * ((1 + step) ** D - (1 - step) ** D)
    measured(relative=-rise / volume_change / pressure - 1)
    np.testing.assert_allclose(-rise / volume_change, pressure, rtol=1e-8)


# --- compute contact/local -----------------------------------------------------------------------


def three(vectors):
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def expected_rows(packing, network):
    """Rows of BONDS to sidej, the particle with the smaller ID first."""
    bonds = network.bonds
    tags = packing.id[network.pairs[bonds.contact]]
    swap = tags[:, 0] > tags[:, 1]
    sign = np.where(swap, -1.0, 1.0)[:, None]
    tags = np.where(swap[:, None], tags[:, ::-1], tags)
    sides = np.where(swap[:, None], bonds.on_side[:, ::-1], bonds.on_side)
    number = np.arange(len(bonds.contact)) - np.searchsorted(bonds.contact, bonds.contact)
    return np.column_stack([
        tags, network.kind[bonds.contact], number, bonds.distance, bonds.reach,
        1 - bonds.distance / bonds.reach, three(sign * bonds.force), three(sign * bonds.normal),
        three(bonds.point), bonds.energy, sides,
    ])  # fmt: skip


def assert_same_rows(found, expected, packing, limit):
    """In any order; points up to periodic images, normals of own images up to their sign."""
    at = {name: k for k, name in enumerate(BONDS)}
    point, vector = [at[c] for c in ("cx", "cy", "cz")], np.arange(at["fx"], at["nz"] + 1)
    plain = [at[c] for c in ("kind", "bond", "dist", "sumrad", "overlap", "energy")]
    sides = [at["sidei"], at["sidej"]]
    assert len(found) == len(expected)
    edges = np.append(packing.box.edges, 1.0)[:3]
    left = list(range(len(expected)))
    for row in found:
        apart = expected[left][:, point] - row[point]
        apart = np.abs(apart - edges * np.round(apart / edges)).max(axis=1)
        same = (expected[left][:, :2] == row[:2]).all(axis=1)
        own_image = row[0] == row[1]
        # Which of both is i, and with it the number, is a matter of choice of own images.
        numbered = packing.compiled().most_bonds <= 2 and not own_image
        if numbered:
            same &= expected[left][:, at["bond"]] == row[at["bond"]]
        choice = np.argmin(np.where(same, apart, np.inf))
        assert same[choice], row
        wanted = expected[left.pop(choice)]
        assert apart[choice] < limit * edges.max()
        flip = -1.0 if own_image and row[vector] @ wanted[vector] < 0 else 1.0
        np.testing.assert_allclose(flip * row[vector], wanted[vector], rtol=0, atol=limit)
        known = [k for k in plain if numbered or k != at["bond"]]
        np.testing.assert_allclose(row[known], wanted[known], rtol=0, atol=limit)
        if own_image:
            assert sorted(row[sides]) == sorted(wanted[sides])
        else:
            assert (row[sides] == wanted[sides]).all()


# Where faces lie on each other, the point is known far less well than the forces.
@pytest.mark.parametrize(
    "case", [marked(c) for c in CASES if not c.name.startswith("extreme")], ids=str
)
def test_rows_of_contact_local_are_the_bonds_of_the_library(case, found_in, request):
    if case.name == CHOSEN:
        request.applymarker(chosen_with_avx512)
    state, _, rows = found_in(case)
    network = find_contacts(state.packing, K_E, case.sides)
    limit = max(10 * limit_of(case.name, network), 1e-13)
    expected = expected_rows(state.packing, network)
    size = max(size_of(network)[0], 1.0)
    assert_same_rows(rows[:, : expected.shape[1]], expected, state.packing, limit * size)
    assert set(rows[:, 3]) == set(expected[:, 3]) == set(range(network.n_bonds.max()))


@EVERY
def test_rows_of_contact_local_add_up_to_the_pressure(case, found_in):
    """Sums of r_l f_k over the rows are what compute packing has as a whole."""
    packing, (_, thermo, rows) = packing_of(case.name), found_in(case)
    at, D = {name: k for k, name in enumerate(BONDS)}, packing.dimension
    force, separation = (rows[:, at[x] : at[x] + D] for x in ("fx", "rx"))
    tensor = force.T @ separation / packing.box.volume
    size = 1e-12 * max(1.0, 1e13 * limit_of(case.name, network_of(case.name, case.sides)))
    pressure = thermo["c_packing[3]"]
    assert np.trace(tensor) / D == pytest.approx(pressure, rel=size)
    assert tensor[0, 1] == pytest.approx(thermo["c_packing[16]"], rel=size, abs=size * pressure)


@pytest.mark.parametrize(
    "case", [marked(case) for case in CASES if case.sides == 1 or case.name in RODS], ids=str
)
def test_stiffness_of_bonds_of_rods(case, found_in):
    rows = found_in(case).rows
    stiffness, kind, bond, reach = (
        rows[:, BONDS.index(name)] for name in ("stiffness", "kind", "bond", "sumrad")
    )
    share, full = stiffness * reach**2 / K_E, bond == 0
    assert (share < 1 + 1e-14).all()
    # Two bonds on their way to one share its stiffness.
    np.testing.assert_allclose(share[full & (kind != ContactKind.SIDE_TO_SIDE)], 1, rtol=1e-15)
    assert (share[full] > 0.5 - 1e-14).all()


# --- compute packing -----------------------------------------------------------------------------


def expected_vector(packing, network):
    """Elements by number: values, and what their rounding is in proportion to."""
    total, counted = sum_forces(packing, network), coordination(packing, network)
    bonds, D = network.bonds, packing.dimension
    bond_force = np.linalg.norm(bonds.force, axis=1).mean()
    net = np.linalg.norm(total.force, axis=1) / bond_force
    torque = np.linalg.norm(total.torque.reshape(packing.n, -1), axis=1)
    gyration = np.sqrt(packing.compiled().moment.max(axis=1))
    largest = np.abs(network.force).max() / bond_force
    n_bonds = network.n_bonds
    if D == 2:
        n_bonds = np.where(network.kind == ContactKind.SIDE_TO_SIDE, 2, n_bonds)
    tensor = np.zeros((3, 3))
    tensor[:D, :D] = total.virial.T / packing.box.volume
    n_1, p_xy = tensor[0, 0] - tensor[1, 1], tensor[0, 1]
    sigma, p = np.hypot(n_1 / 2, p_xy), total.pressure
    plain = {
        1: packing.phi, 2: total.energy / packing.box.volume, 3: p, 4: counted.z,
        9: counted.z_single, 10: counted.n_rattlers, 11: n_bonds.sum(),
        12: (1 - bonds.distance / bonds.reach).max(),
    }  # fmt: skip
    of_forces = {
        7: net.max(), 8: np.sqrt((net**2).mean()), 13: (torque / gyration).max() / bond_force,
    }  # fmt: skip
    of_stress = {
        15: n_1, 16: p_xy, 17: sigma, 19: tensor[0, 2], 20: tensor[1, 2],
        21: tensor[1, 1] - tensor[2, 2] if D == 3 else 0.0,
    }  # fmt: skip
    found = {k: (value, abs(value)) for k, value in plain.items()}
    found |= {k: (value, max(value, largest)) for k, value in of_forces.items()}
    found |= {k: (value, p) for k, value in of_stress.items()}
    return found | {18: (sigma / p, 1.0)}


@EVERY
def test_compute_packing_is_what_the_library_measures(case, found_in, measured, request):
    if case.name == CHOSEN:
        request.applymarker(chosen_with_avx512)
    state, thermo, _ = found_in(case)
    network = find_contacts(state.packing, K_E, case.sides)
    expected = expected_vector(state.packing, network)
    measured(z=expected[4][0], rattlers=expected[10][0], overlap=expected[12][0])
    limit = max(1e-12, 10 * limit_of(case.name, network))
    for element, (value, size) in expected.items():
        found, is_count = thermo[f"c_packing[{element}]"], element in (4, 9, 10, 11)
        rounding = 1e-14 if is_count else limit
        assert found == pytest.approx(value, rel=0, abs=rounding * size), element
    if state.packing.compiled().most_bonds == 1:
        assert thermo["c_packing[4]"] == thermo["c_packing[9]"]


@EVERY
def test_order_is_that_of_the_library(case, found_in):
    packing, thermo = packing_of(case.name), found_in(case).thermo
    at = {"S2": 5, "S4": 6, "C4": 14}
    for name, value in order(packing).items():
        found = thermo[f"c_packing[{at[name]}]"]
        # 0 where no particle has a direction; C4 is of superellipsoids, also of spheres.
        if np.isnan(value):
            assert found == 0.0 or name == "C4", name
        elif name != "C4" or found != 0.0:
            assert found == pytest.approx(value, rel=1e-11, abs=1e-13), name
    director = planar_order(packing).theta_n if packing.dimension == 2 else 0.0
    turn = thermo["c_packing[22]"] - director
    if thermo["c_packing[5]"] > 1e-6:
        assert abs(turn - np.pi * np.round(turn / np.pi)) < 1e-11
