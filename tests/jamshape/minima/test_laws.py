"""Minima under laws of any power: searches for an energy at overlaps of all sizes, and what follows from the law."""

import numpy as np
import pytest
from thinned import quick

import jamshape as js
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import energy_onset
from jamshape.minima.descent import rounding_floor
from jamshape.shapes.shape import Interaction
from jamshape.vibration.hessian import dynamical_matrix

POWERS = pytest.mark.parametrize("law", ["hertz", 3.0, 4.0])
OVERLAPS = pytest.mark.parametrize("overlap", [0.03, 1e-3, 1e-5, 1e-8])


def made(law, overlap, **more):
    particles = js.Spherocylinders(alpha=more.pop("alpha", 0), law=law)
    u0 = overlap**particles.power / particles.power
    return js.make_packing(particles, n=16, seed=2, u0=u0, progress=False, **more)


@POWERS
@OVERLAPS
@pytest.mark.parametrize("alpha", [0, 1])
def test_forces_balance_at_the_energy(alpha, overlap, law):
    packing = made(law, overlap, alpha=alpha)
    u0 = overlap**packing.law.power / packing.law.power
    assert packing.results["outcome"] in {"converged", "kink"}
    assert packing.u == pytest.approx(u0, rel=1e-7, abs=0)
    assert packing.results["residual"] <= 1e-8
    found = packing.contacts().bonds
    x = 1 - found.distance / found.reach
    assert 0.1 < x.mean() / overlap < 10


@POWERS
def test_a_root_of_the_energy_is_linear_in_phi(law):
    """Two packings with the same contacts extrapolate to the same onset, to second order."""
    near = made(law, 1e-5)
    nearer = js.minimise(near, u0=near.u * 1e-2**near.law.power, progress=False)
    onsets = [one.results["phi_J"] for one in (near, nearer)]
    assert near.phi - nearer.phi > 1e-6
    assert abs(onsets[0] - onsets[1]) < 1e-3 * (near.phi - nearer.phi)
    plain = energy_onset(near.phi, near.u, near.pressure)
    assert abs(plain - onsets[1]) > 0.05 * (near.phi - nearer.phi)


@POWERS
def test_default_energies_are_those_of_the_same_overlaps(law):
    A = Interaction().but(power=law).power
    harmonic, other = (js.make_packing(js.Spherocylinders(alpha=0, law=of), n=12, progress=False) for of in (2, law))  # fmt: skip
    assert harmonic.u == pytest.approx(1e-15, rel=1e-7)
    assert other.u == pytest.approx(2 / A * 1e-15 ** (A / 2), rel=1e-7)
    means = [
        (1 - bonds.distance / bonds.reach).mean()
        for bonds in (one.contacts().bonds for one in (harmonic, other))
    ]
    assert means[1] == pytest.approx(means[0], rel=0.3)


@POWERS
def test_pressures_are_led_to_by_powers(law):
    packing = made(law, 1e-4)
    exponent = packing.law.power - 1
    for factor in (0.1, 3.0):
        p = packing.pressure * factor**exponent
        other = js.minimise(packing, pressure=p, progress=False)
        assert other.pressure == pytest.approx(p, rel=1e-8)
    run = js.ladder(packing, pressure=[packing.pressure * 0.1**exponent], progress=False)
    assert run["pressure"][-1] == pytest.approx(packing.pressure * 0.1**exponent, rel=1e-7)


@pytest.mark.parametrize("law", quick(["hertz", 3.0, 4.0], ["hertz"]))
def test_boxes_yield_freely_and_are_stable(law):
    particles = js.Spherocylinders(alpha=0, law=law)
    p = 1e-4 ** (particles.power - 1)
    found = js.make_packing(
        particles, n=16, pressure=p, box="free", stable_to_shear=True, progress=False
    )
    assert found.pressure == pytest.approx(p, rel=1e-8)
    assert js.modes(found).moduli.is_stable_to_shear


@POWERS
def test_moduli_are_those_of_strained_packings(law):
    """The bulk modulus against pressures of packings at volumes next to each other."""
    packing = made(law, 1e-3)
    bulk = js.modes(packing).moduli.bulk.relaxed
    step = 1e-5 * (packing.phi - packing.results["phi_J"])
    pressures = [
        js.minimise(packing, phi=phi, tolerance=1e-12, progress=False).pressure
        for phi in (packing.phi - step, packing.phi + step)
    ]
    expected = packing.phi * (pressures[1] - pressures[0]) / (2 * step)
    assert bulk == pytest.approx(expected, rel=1e-5)


@pytest.mark.parametrize("power", [2.0, 2.5, 4.0])
def test_the_stiffness_of_a_bond_follows_from_its_force(power):
    packing = made(power, 1e-3)
    landscape = Landscape(packing)
    evaluation = landscape.evaluate(State.of(packing))
    matrix = dynamical_matrix(landscape, State.of(packing))
    mean = matrix.bonds.stiffness.mean() * landscape.length**2
    assert landscape.stiffness_at(evaluation.bond_force) == pytest.approx(mean, rel=0.5)
    if power == 2:
        assert landscape.stiffness_at(evaluation.bond_force) == 1.0
    assert 0 < rounding_floor(evaluation, landscape) < 1e-13


def test_a_protocol_of_harmonic_pressures_refuses_other_laws():
    with pytest.raises(
        ValueError,
        match="the protocol dynamics has pressures of harmonic contacts, found the law hertz",
    ):
        js.make_packing(js.Spherocylinders(law="hertz"), protocol="dynamics", progress=False)


@pytest.mark.parametrize(
    ("law", "u0"), [("harmonic", 1e-21), ("hertz", 1e-27), (4.0, 1e-42), ("hertz", 0.02)]
)
def test_ranges_of_energies_follow_the_law(law, u0):
    with pytest.raises(ValueError, match=f"u0 is {u0!r}, expected 0 or an energy density from"):
        js.make_packing(js.Spherocylinders(law=law), u0=u0, progress=False)


@pytest.mark.lammps
@pytest.mark.parametrize("law", ["hertz", 4.0])
def test_explicit_and_implicit_steps_agree(law):
    """Steady shear of a dense start: stages of implicit steps are minimisations."""
    discs = js.Spherocylinders(alpha=1, law="harmonic")
    start = js.make_packing(discs, n=12, phi=0.92, progress=False)
    start = start.with_(law=start.law.but(power=law))
    common = {
        "start": start,
        "gdot": 1e-3,
        "strain": 0.02,
        "integration_tolerance": 1e-5,
        "rows": 20,
    }
    pressures = [
        js.shear(integrator=name, progress=False, **common).pressure[-1]
        for name in ("rkc2", "tr-bdf2")
    ]
    assert pressures[1] == pytest.approx(pressures[0], rel=1e-4)
    assert np.isfinite(pressures).all()


@pytest.mark.lammps
def test_a_file_of_another_law_is_refused(tmp_path):
    """Either way, of packings, of compressions in LAMMPS and of implicit ones."""
    hertz, harmonic = (js.Spherocylinders(alpha=0, law=law) for law in ("hertz", "harmonic"))
    calls = [
        lambda of, file: js.make_packing(of, n=8, u0=1e-8, protocol="marschall-2018", kappa=1e-2, phi_start=0.5, phi_end=0.9, file=file, progress=False),
        lambda of, file: js.compress(of, n=8, kappa=1e-2, phi=(0.4, 0.5), rows=20, file=file, progress=False),
        lambda of, file: js.slow_compress(of, n=8, kappa=1e-2, phi=(0.4, 0.5), file=file, progress=False),
    ]  # fmt: skip
    for k, call in enumerate(calls):
        for one, other in ((hertz, harmonic), (harmonic, hertz)):
            file = tmp_path / f"{k}_{one.power}.h5"
            call(one, file)
            call(one, file)
            with pytest.raises(ValueError, match="law"):
                call(other, file)
