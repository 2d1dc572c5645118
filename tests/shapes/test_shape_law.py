"""The power of the law of contacts, through all that depends on the law."""

import math

import numpy as np
import pytest
from every_shape import MIXTURES, ROUNDING, SIDES, TYPICAL, pressed, scattered, squeezed

import jamshape as js
from jamshape.contacts import find_contacts
from jamshape.front.packing import public
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.shapes.particles import Particles

EVERYWHERE = pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
POWERS = pytest.mark.parametrize("power", [2.5, 3.0, 4.0])
K_E = 1.7


def under(case, power):
    packing = pressed(case)
    return packing.with_(law=js.Interaction(K_E, SIDES, power))


@POWERS
@EVERYWHERE
def test_bonds_have_powers_of_their_overlaps(case, power):
    """With one bond of a contact; those of flat ones share an energy, and of a small one the larger power is rounding."""
    packing = under(case, power)
    found, harmonic = find_contacts(packing), find_contacts(packing.with_(law=js.Interaction(K_E)))
    np.testing.assert_array_equal(found.pairs, harmonic.pairs)
    single = np.flatnonzero((found.n_bonds == 1) & (harmonic.n_bonds == 1))
    bonds, are_alone = found.bonds, np.isin(found.bonds.contact, single)
    forces = harmonic.bonds.force[np.isin(harmonic.bonds.contact, single)]
    assert are_alone.sum() > 0
    x = (1 - bonds.distance / bonds.reach)[are_alone]
    force = np.linalg.norm(bonds.force[are_alone], axis=1)
    rounding = 64 * np.finfo(float).eps / x.min()
    np.testing.assert_allclose(bonds.energy[are_alone], K_E * x**power / power, rtol=rounding)
    slope = K_E * x ** (power - 1) / bonds.reach[are_alone]
    np.testing.assert_allclose(force, slope, rtol=rounding)
    expected = forces * x[:, None] ** (power - 2)
    atol = rounding * np.abs(forces).max()
    np.testing.assert_allclose(bonds.force[are_alone], expected, rtol=0, atol=atol)


@POWERS
@EVERYWHERE
def test_packs_have_the_sums_of_single_pairs(case, power):
    packing = under(case, power)
    landscape, state = Landscape(packing), State.of(packing)
    model = LocalEnergyModel(landscape, state)
    x = np.zeros(landscape.size)
    in_packs, singly = (model.evaluate(x, 0.0, extended=flag) for flag in (False, True))
    tolerance = 10 * ROUNDING
    assert in_packs.energy == pytest.approx(singly.energy, rel=tolerance)
    assert in_packs.bond_force == pytest.approx(singly.bond_force, rel=tolerance)
    error = np.abs(in_packs.gradient - singly.gradient).max()
    assert error <= tolerance * max(singly.bond_force, np.abs(singly.gradient).max())


@pytest.mark.parametrize("power", [2.5, 4.0])
@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_second_derivatives_are_differences_of_forces(case, power):
    packing = under(case, power)
    landscape, state = Landscape(packing), State.of(packing)
    model = LocalEnergyModel(landscape, state)
    hessian = landscape.curvature(state).hessian
    rng = np.random.default_rng(8)
    along = rng.uniform(-1, 1, landscape.size)
    step = 1e-7 * landscape.length
    ahead, behind = (
        model.evaluate(s * step * along, 0.0, extended=True).gradient for s in (1.0, -1.0)
    )
    expected = np.asarray((ahead - behind) / (2 * step), np.float64)
    if case.dimension == 3:  # rotation vectors do not commute: by the symmetric part of differences
        expected_along = along @ expected
        assert along @ (hessian @ along) == pytest.approx(expected_along, rel=1e-6)
        return
    np.testing.assert_allclose(
        hessian @ along, expected, rtol=0, atol=1e-6 * np.abs(expected).max()
    )


@pytest.mark.lammps
@pytest.mark.parametrize("power", [2.5, 3.0])
@EVERYWHERE
def test_lammps_has_it_by_the_pair_style(case, power):
    packing = public(under(case, power))
    ours = js.energy(packing)
    with Session() as session:
        session.load(packing)
        session.interact(packing.law)
        session.commands(f"{session.neighbours()}\nthermo_modify norm no\nrun 0 post no")
        rank = np.argsort(np.argsort(packing.id))
        U = session.lmp.get_thermo("pe")
        force = np.array(session.lmp.gather("f", 1, 3)).reshape(-1, 3)[rank]
        again = js.load(session)
    assert pytest.approx(ours.U, rel=1e-12) == U
    size = np.abs(ours.contacts.force).max()
    np.testing.assert_allclose(force[:, : case.dimension], ours.forces, rtol=0, atol=1e-11 * size)
    assert again.law == packing.law


@pytest.mark.parametrize("end", ["h5", "data", "gsd"])
@EVERYWHERE
def test_files_keep_it(case, end, tmp_path):
    if end == "gsd":
        pytest.importorskip("gsd")
    packing = public(under(case, 2.5))
    js.save(tmp_path / f"hertz.{end}", packing)
    found = js.load(tmp_path / f"hertz.{end}")
    assert found.law == packing.law
    assert found.u == pytest.approx(packing.u, rel=1e-13)


@pytest.mark.parametrize("law", ["hertz", 3.0, "power 3.5"])
@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_minima_balance_forces(case, law):
    """From a state squeezed by harmonic contacts."""
    packing = squeezed(case)
    packing = packing.with_(law=packing.law.but(power=law))
    found = js.minimise(public(packing), progress=False)
    assert found.law == packing.law
    assert found.results["outcome"] in {"converged", "kink", "sliding"}
    assert found.results["residual"] < 1e-5


@pytest.mark.parametrize("law", ["hertz", 3.0])
@pytest.mark.parametrize("case", TYPICAL, ids=str)
def test_particles_bring_their_law_along(case, law):
    particles = Particles.of(case.shape).under(law)
    assert Particles.again(case.shape, particles.told) is not None
    assert Particles.again(case.shape, particles.told).power == particles.power
    packing = js.make_packing(particles, dimension=case.dimension, n=8, u0=1e-9, progress=False)
    assert packing.law.power == particles.power
    assert packing.u == pytest.approx(1e-9, rel=1e-6)


def test_harmonic_contacts_are_the_default_and_say_nothing():
    packing = scattered(TYPICAL[0])
    assert packing.law == js.Interaction() == js.Interaction(1.0, 2, 2.0)
    assert "power" not in packing.law.stated()
    assert "law" not in Particles.of(TYPICAL[0].shape).under("harmonic").told


@pytest.mark.parametrize("law", [1.9, math.nan, math.inf, "hooke", "", None, "power 1", [2.5]])
def test_other_laws_are_refused(law):
    with pytest.raises(
        (TypeError, ValueError), match=r"law is .*, expected harmonic, hertz or a power"
    ):
        Particles.of(TYPICAL[0].shape).under(law)
