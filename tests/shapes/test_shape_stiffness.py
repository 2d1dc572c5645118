"""A stiffness of its own for each pair of species, through all that depends on the law of contacts."""

import numpy as np
import pytest
from every_shape import MIXTURES, ROUNDING, SIDES, TYPICAL, close_to, pressed, stiffnesses

import jamshape as js
from jamshape.contacts import find_contacts
from jamshape.front.packing import public
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.shapes.shape import Interaction

EVERYWHERE = pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)


def mixed(case):
    """Particles of two species or more, stiffer towards their own kind."""
    packing = pressed(case)
    packing = packing.with_(species=1 + np.arange(packing.n) % max(2, packing.species.max()))
    return packing.with_(law=Interaction(stiffnesses(packing), SIDES))


@EVERYWHERE
def test_each_contact_has_the_stiffness_of_its_species(case):
    packing = mixed(case)
    found, one = find_contacts(packing), find_contacts(packing, 1.0)
    i, j = packing.species[found.pairs.T] - 1
    k_e = stiffnesses(packing)[i, j]
    assert len(np.unique(k_e)) >= 3
    np.testing.assert_array_equal(found.pairs, one.pairs)
    np.testing.assert_allclose(found.energy, k_e * one.energy, rtol=ROUNDING)
    atol = ROUNDING * np.abs(found.force).max()
    np.testing.assert_allclose(found.force, k_e[:, None] * one.force, rtol=0, atol=atol)


@EVERYWHERE
def test_a_table_of_one_number_has_the_bits_of_the_number(case):
    packing = mixed(case)
    table = np.full_like(stiffnesses(packing), 2.5)
    state = State.of(packing)
    one, same = Landscape(packing, 2.5), Landscape(packing, table)
    for extended in (False, True):
        a, b = (of.evaluate(state, extended=extended) for of in (one, same))
        assert (a.energy, a.strain_gradient, a.bond_force) == (b.energy, b.strain_gradient, b.bond_force)  # fmt: skip
        np.testing.assert_array_equal(a.gradient, b.gradient)
        a, b = (of.curvature(state, extended=extended) for of in (one, same))
        assert abs(a.hessian - b.hessian).max() == 0
    x, step = np.zeros(one.size), np.full(one.size, 1e-5)
    a, b = (LocalEnergyModel(of, state) for of in (one, same))
    for at in (x, step):
        a_sums, b_sums = (of.evaluate(at, 1e-5, extended=False) for of in (a, b))
        assert a_sums.energy == b_sums.energy
        np.testing.assert_array_equal(a_sums.gradient, b_sums.gradient)


@EVERYWHERE
def test_the_vicinity_has_the_stiffness_of_the_landscape(case):
    packing = mixed(case)
    landscape, state = Landscape(packing), State.of(packing)
    local_model, x = LocalEnergyModel(landscape, state), np.zeros(landscape.size)
    found = local_model.evaluate(x, 0.0, extended=False)
    expected = Landscape(packing).evaluate(state)
    assert found.energy == close_to(expected.energy, ROUNDING)
    assert np.abs(found.gradient - expected.gradient).max() <= ROUNDING * max(
        expected.bond_force, np.abs(expected.gradient).max()
    )
    hessian = landscape.curvature(state).hessian.toarray()
    shift = max(0.0, -2 * np.linalg.eigvalsh(hessian)[0]) + 1.0
    right = np.random.default_rng(4).normal(size=landscape.size)
    solved = local_model.factorise(x, 0.0, np.full(landscape.size, shift)).solve(right)
    left = hessian + shift * np.eye(landscape.size)
    assert np.abs(left @ solved - right).max() <= 1e-10 * np.abs(left).max()


@pytest.mark.lammps
@EVERYWHERE
def test_lammps_has_it_by_pair_coeff(case):
    packing = public(mixed(case))
    ours = js.energy(packing)
    with Session() as session:
        session.load(packing)
        session.interact(packing.law)
        session.commands(f"{session.neighbours()}\nthermo_modify norm no\nrun 0 post no")
        rank = np.argsort(np.argsort(packing.id))
        U = session.lmp.get_thermo("pe")
        force = np.array(session.lmp.gather("f", 1, 3)).reshape(-1, 3)[rank]
        torque = np.array(session.lmp.gather("torque", 1, 3)).reshape(-1, 3)[rank]
    assert pytest.approx(ours.U, rel=1e-12) == U
    size = np.abs(ours.contacts.force).max()
    np.testing.assert_allclose(force[:, : case.dimension], ours.forces, rtol=0, atol=1e-11 * size)
    torque = torque[:, 2] if case.dimension == 2 else torque
    size *= packing.outer_radius.max()
    np.testing.assert_allclose(torque, ours.torques, rtol=0, atol=1e-10 * size)


@pytest.mark.parametrize("end", ["h5", "data", "gsd"])
@EVERYWHERE
def test_files_keep_it(case, end, tmp_path):
    if end == "gsd":
        pytest.importorskip("gsd")
    packing = public(mixed(case))
    js.save(tmp_path / f"mixed.{end}", packing)
    found = js.load(tmp_path / f"mixed.{end}")
    assert found.law == packing.law
    assert found.u == pytest.approx(packing.u, rel=1e-13)
