"""compute contact/local and compute packing against the bindings."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_scenes import (
    SIDES,
    dense,
    dense_mixture,
    error_of,
    global_vector,
    load_plugin,
    loaded,
    relaxed,
    rods,
    rods_3d,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
    tiny_box,
    with_odd_ids,
)

from jamshape import contacts
from jamshape.measures.order import orientational_order

pytestmark = pytest.mark.lammps

COLUMNS = [
    "itag",
    "jtag",
    "kind",
    "bond",
    "dist",
    "sumrad",
    "overlap",
    "fx",
    "fy",
    "fz",
    "nx",
    "ny",
    "nz",
    "cx",
    "cy",
    "cz",
    "energy",
    "stiffness",
    "sidei",
    "sidej",
]


SCENES = {
    "rods": lambda: with_odd_ids(dense(n=32), 2),
    "mixture": lambda: dense_mixture(n=32),
    "rods 3d": lambda: dense(3, alpha=3.0, n=32, phi=0.8),
    "tiny box": tiny_box,
}


def three(vectors):
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def expected_rows(packing, sides):
    """Rows of COLUMNS from the bindings, i being the particle with the smaller ID."""
    network = contacts.find_contacts(packing, k_e=1.0, sides=SIDES[sides])
    bonds = network.bonds
    tags = packing.id[network.pairs[bonds.contact]]
    swap = tags[:, 0] > tags[:, 1]
    sign = np.where(swap, -1.0, 1.0)[:, None]
    tags[swap] = tags[swap, ::-1]
    side = bonds.on_side.astype(float)
    side[swap] = side[swap, ::-1]
    is_second = np.r_[False, bonds.contact[1:] == bonds.contact[:-1]]
    return np.column_stack([
        tags, network.kind[bonds.contact], is_second, bonds.distance, bonds.reach,
        1 - bonds.distance / bonds.reach, three(sign * bonds.force), three(sign * bonds.normal),
        three(bonds.point), bonds.energy, np.full(len(tags), np.nan), side,
    ])  # fmt: skip


def found_rows(session, names=COLUMNS):
    style_local, array = 2, 2
    return (
        session.lmp.numpy.extract_compute("bonds", style_local, array)
        .copy()
        .reshape(-1, len(names))
    )


def assert_same_rows(found, expected, packing):
    """In any order; points up to periodic images, normals of own images up to their sign."""
    column = {name: k for k, name in enumerate(COLUMNS)}
    point, vector = [column[c] for c in ("cx", "cy", "cz")], [column["fx"] + k for k in range(6)]
    plain = [column[c] for c in ("kind", "bond", "dist", "sumrad", "overlap", "energy")]
    sides = [column["sidei"], column["sidej"]]
    assert len(found) == len(expected)
    edges = np.append(packing.box.edges, 1.0)[:3]
    left = list(range(len(expected)))
    for row in found:
        apart = expected[left][:, point] - row[point]
        apart = np.abs(apart - edges * np.round(apart / edges)).max(axis=1)
        same = (expected[left][:, :2] == row[:2]).all(axis=1)
        same &= expected[left][:, column["bond"]] == row[column["bond"]]
        choice = np.argmin(np.where(same, apart, np.inf))
        assert same[choice], row
        assert apart[choice] < 1e-13
        wanted = expected[left.pop(choice)]
        np.testing.assert_allclose(row[plain], wanted[plain], rtol=1e-12, atol=1e-14)
        own_image = row[0] == row[1]
        flip = -1.0 if own_image and row[vector] @ wanted[vector] < 0 else 1.0
        np.testing.assert_allclose(flip * row[vector], wanted[vector], rtol=0, atol=1e-13)
        assert (
            sorted(row[sides]) == sorted(wanted[sides])
            if own_image
            else (row[sides] == wanted[sides]).all()
        )


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("name", SCENES)
def test_rows_are_the_bonds_of_the_bindings(name, sides, newton, tmp_path):
    with loaded(SCENES[name](), tmp_path, sides=sides, newton=newton) as session:
        session.commands(f"compute bonds all contact/local {' '.join(COLUMNS)}\nrun 0")
        found, state = found_rows(session), state_of(session)
    expected = expected_rows(state.exact, sides)
    assert_same_rows(found, expected, state.packing)
    stiffness = found[:, COLUMNS.index("stiffness")]
    full = found[:, COLUMNS.index("bond")] == 0
    reach = found[:, COLUMNS.index("sumrad")]
    assert (stiffness * reach**2 < 1 + 1e-14).all()
    # Two bonds on their way to one share its stiffness.
    one = full & (found[:, COLUMNS.index("kind")] != contacts.ContactKind.SIDE_TO_SIDE)
    np.testing.assert_allclose(stiffness[one], 1 / reach[one] ** 2, rtol=1e-15)
    assert (stiffness[full] * reach[full] ** 2 > 0.5 - 1e-14).all()


@pytest.mark.parametrize("newton", ["on", "off"])
def test_two_ranks_report_the_same_rows(newton, tmp_path):
    for name, build in SCENES.items():
        out = tmp_path / name.replace(" ", "_")
        packing = build()
        run_lmp_well(
            f"""{load_plugin()}
            {scene(packing, out.with_suffix(".data"), sides="two", newton=newton)}
            compute bonds all contact/local {" ".join(COLUMNS)}
            dump bonds all local 1 {out} c_bonds[*]
            dump_modify bonds format float %.17g
            run 0""",
            tmp_path, ranks=2,
        )  # fmt: skip
        found = np.loadtxt(out, skiprows=9, ndmin=2)
        with loaded(packing, tmp_path, sides="two") as session:
            session.commands("run 0")
            state = state_of(session)
        assert_same_rows(found, expected_rows(state.exact, "two"), state.packing)


@pytest.mark.parametrize("name", SCENES)
def test_stress_of_the_kinds_of_contacts_adds_up(name, tmp_path):
    """Sums of ry fx over the rows of each kind are what compute packing has as a whole."""
    columns = ["kind", "fx", "fy", "fz", "rx", "ry", "rz"]
    packing = SCENES[name]()
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"compute bonds all contact/local {' '.join(columns)}")
        session.commands("compute p all packing\nrun 0")
        found, whole = found_rows(session, columns), global_vector(session, "p")
    D = packing.dimension
    tensors = [
        of[:, 1 : 1 + D].T @ of[:, 4 : 4 + D] / packing.box.volume
        for of in (found[found[:, 0] == kind] for kind in np.unique(found[:, 0]))
    ]
    assert len(tensors) > 1
    total = sum(tensors)
    assert total[0, 1] == pytest.approx(whole[15], rel=1e-12, abs=1e-12 * whole[2])
    assert np.trace(total) / D == pytest.approx(whole[2], rel=1e-12)


def test_columns_come_in_any_order(tmp_path):
    packing = SCENES["rods"]()
    rng = np.random.default_rng(1)
    shuffled = [str(name) for name in rng.permutation(COLUMNS)]
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"""
            compute bonds all contact/local {" ".join(COLUMNS)}
            compute other all contact/local {" ".join(shuffled)} itag itag
            compute one all contact/local dist
            run 0""")
        lmp = session.lmp.numpy
        plain = found_rows(session)
        other = lmp.extract_compute("other", 2, 2).copy()
        one = session.lmp.extract_compute("one", 2, 1)[: len(plain)]
    for k, name in enumerate(shuffled):
        np.testing.assert_array_equal(other[:, k], plain[:, COLUMNS.index(name)])
    np.testing.assert_array_equal(other[:, -1], plain[:, 0])
    np.testing.assert_array_equal(one, plain[:, COLUMNS.index("dist")])


def test_no_contact_is_no_row(tmp_path):
    packing = rods([[0, 0], [5, 0]], 0.0, 0.5, 0.5, [20, 20])
    out = run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "s.data")}
        compute bonds all contact/local itag dist
        compute packing all packing
        dump bonds all local 1 {tmp_path / "bonds"} c_bonds[*]
        thermo_style custom step c_packing[*]
        run 0""",
        tmp_path,
    )
    assert "nan" not in out
    assert (tmp_path / "bonds").read_text().split("ITEM: ENTRIES")[1].split("\n", 1)[1] == ""


# --- compute packing -----------------------------------------------------------------------------


def jammed(dimension, alpha, sides):
    """Near a minimum; of 40 nearly round particles some rattle."""
    phi = {2: 0.83, 3: 0.64}[dimension]
    start = dense(dimension, alpha=alpha, n=40, phi=phi, kick=0.0, seed=4)
    return with_odd_ids(relaxed(start, 2000, sides=sides), 3)


def tensor_order(axes):
    """Largest eigenvalue of the nematic tensor, and mean P_4 about its eigenvector."""
    values, vectors = np.linalg.eigh(1.5 * axes.T @ axes / len(axes) - 0.5 * np.eye(3))
    c = axes @ vectors[:, -1]
    return values[-1], np.mean((35 * c**4 - 30 * c**2 + 3) / 8)


def expected_vector(state, sides):
    packing = state.exact
    network = contacts.find_contacts(packing, k_e=1.0, sides=SIDES[sides])
    found = contacts.sum_forces(packing, network)
    counted = contacts.coordination(packing, network)
    has_axis = packing.half_length > 0
    director = 0.0
    if packing.dimension == 2:
        angles = packing.orientation[has_axis]
        director = np.angle(np.exp(2j * angles).sum()) / 2
        orders = [orientational_order(angles, n).S_n if has_axis.any() else 0.0 for n in (2, 4)]
        side_bonds = np.where(network.kind == 2, 2, network.n_bonds).sum()
    else:
        orders = tensor_order(packing.axes[has_axis]) if has_axis.any() else [0.0, 0.0]
        side_bonds = network.n_bonds.sum()
    bond_force = np.linalg.norm(network.bonds.force, axis=1).mean()
    net = np.linalg.norm(found.force, axis=1) / bond_force
    moment = packing.compiled().moment
    torque = np.linalg.norm(found.torque.reshape(packing.n, -1), axis=1)
    return {
        "phi": packing.phi,
        "u": found.energy / packing.box.volume,
        "p": found.pressure,
        "z": counted.z,
        "S_2": orders[0],
        "S_4": orders[1],
        "fmax": net.max(),
        "frms": np.sqrt((net**2).mean()),
        "z_single": counted.z_single,
        "rattlers": counted.n_rattlers,
        "bonds": side_bonds,
        "overlap": (1 - network.bonds.distance / network.bonds.reach).max(),
        "tmax": (torque / np.sqrt(moment.max(axis=1))).max() / bond_force,
        "C_4": 0.0,
        **expected_stress(found, packing.box.volume),
        "director": director,
    }


def expected_stress(found, volume):
    """What of the pressure tensor p_kl = sum r_l f_k / V is told beside its trace."""
    D = len(found.virial)
    tensor = np.zeros((3, 3))
    tensor[:D, :D] = found.virial.T / volume
    n_1, p_xy = tensor[0, 0] - tensor[1, 1], tensor[0, 1]
    sigma = np.hypot(n_1 / 2, p_xy)
    return {
        "n_1": n_1,
        "p_xy": p_xy,
        "sigma": sigma,
        "mu": sigma / found.pressure,
        "p_xz": tensor[0, 2],
        "p_yz": tensor[1, 2],
        "n_2": tensor[1, 1] - tensor[2, 2] if D == 3 else 0.0,
    }


def assert_same_vector(found, expected):
    for name, value in zip(expected, found, strict=True):
        tolerance = 1e-11 if name in {"fmax", "frms", "tmax"} else 1e-12
        np.testing.assert_allclose(value, expected[name], rtol=1e-12, atol=tolerance, err_msg=name)


@pytest.mark.parametrize("sides", SIDES)
@pytest.mark.parametrize("alpha", [0.0, 0.02, 4.0])
@pytest.mark.parametrize("dimension", [2, 3])
def test_packing_vector(dimension, alpha, sides, tmp_path, measured):
    packing = jammed(dimension, alpha, sides)
    with loaded(packing, tmp_path, sides=sides) as session:
        session.commands(
            "compute packing all packing\nthermo_style custom step c_packing[1]\nrun 0"
        )
        found, state = global_vector(session, "packing"), state_of(session)
    expected = expected_vector(state, sides)
    measured(z=expected["z"], rattlers=expected["rattlers"], overlap=expected["overlap"])
    assert_same_vector(found, expected)
    out = run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "s.data", sides=sides, newton="off")}
        compute packing all packing
        thermo_style custom step c_packing[*]
        thermo_modify format float %.17g
        run 0""",
        tmp_path, ranks=2,
    )  # fmt: skip
    row = out.split("c_packing[22]")[1].strip().split("\n")[0].split()
    assert_same_vector(np.array(row[1:], float), expected)


def test_some_scenes_have_rattlers():
    packing = jammed(2, 0.02, "two")
    assert 0 < contacts.find_rattlers(packing, contacts.find_contacts(packing, sides=2)).sum() < 40


@pytest.mark.parametrize("n", [8, 500])
def test_order_in_space(n, tmp_path):
    rng = np.random.default_rng(n)
    cells = np.stack(np.unravel_index(np.arange(n), (8, 8, 8)), axis=1)
    spread = rng.normal(size=(n, 4))
    for quaternion in (spread, [1.0, 0.3, -0.2, 0.5]):
        packing = rods_3d(4.0 * cells - 16.0, quaternion, 1.0, 0.5, [32.0] * 3)
        with loaded(packing, tmp_path) as session:
            session.commands("""
                compute packing all packing
                thermo_style custom step c_packing[1]
                run 0""")
            S_2, S_4 = global_vector(session, "packing")[4:6]
        np.testing.assert_allclose((S_2, S_4), tensor_order(packing.axes), rtol=1e-12)
        if quaternion is not spread:
            np.testing.assert_allclose((S_2, S_4), 1.0, rtol=1e-14)
    assert tensor_order(rods_3d(4.0 * cells, spread, 1.0, 0.5, [32.0] * 3).axes)[0] < 3 / n**0.5


NO_PAIR_STYLE = (
    " found pair_style zero, expected one of jamshape's: use 'pair_style SHAPE/harmonic'."
)


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (
            "compute c all contact/local itag nonsense",
            "compute contact/local found column 'nonsense', expected one of: "
            + " ".join(sorted([*COLUMNS, "rx", "ry", "rz"]))
            + ".",
        ),
        (
            "compute c all contact/local",
            "compute contact/local found no column, expected one or more such as itag.",
        ),
        (
            "group half id 1\ncompute c half contact/local itag",
            "compute contact/local found a group other than all, expected 'all'.",
        ),
        (
            "group half id 1\ncompute c half packing",
            "compute packing found a group other than all, expected 'all'.",
        ),
        ("compute c all packing phi", "compute packing found arguments, expected none."),
        (
            "pair_style zero 1.0\npair_coeff * *\ncompute c all packing\nrun 0",
            "compute packing" + NO_PAIR_STYLE,
        ),
        (
            "pair_style zero 1.0\npair_coeff * *\ncompute c all contact/local itag\nrun 0",
            "compute contact/local" + NO_PAIR_STYLE,
        ),
    ],
)
def test_wrong_use_ends_in_one_sentence(command, sentence, tmp_path):
    packing = rods([[0, 0], [5, 0]], 0.0, 0.5, 0.5, [20, 20])
    done = run_lmp(f"{load_plugin()}\n{scene(packing, tmp_path / 's.data')}\n{command}", tmp_path)
    assert error_of(done) == sentence
