"""Packings of every shape in boxes with a tilt: minima, modes, energies, slow compression and hosts."""

import math
from functools import cache

import numpy as np
import pytest
from every_shape import EPS, SIDES, TYPICAL, close_to, scattered, squeezed, tilted

from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow import implicit
from jamshape.flow.implicit import Flow, Protocol
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.minima import Outcome, Stop, minimise
from jamshape.minima.target import Target, find
from jamshape.packing import Box, State
from jamshape.protocols.thermal import Thermal, equilibrate
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.statistics import count

EVERY = pytest.mark.parametrize("case", TYPICAL, ids=str)
PLANE = pytest.mark.parametrize("case", [c for c in TYPICAL if c.dimension == 2], ids=str)
U0 = 1e-10


@cache
def minimum(case):
    """Led to an energy just above jamming."""
    packing = tilted(case)
    return Landscape(packing, sides=SIDES), find(
        Landscape(packing, sides=SIDES), State.of(packing), Target(U0)
    )


@EVERY
def test_minimisation_ends_at_its_tolerance(case, measured):
    packing = tilted(case)
    landscape, state = Landscape(packing, sides=SIDES), State.of(packing)
    found = minimise(landscape, state, "newton", Stop(tolerance=1e-8))
    measured(residual=found.residual.largest, energy=found.evaluation.energy)
    assert found.outcome in {Outcome.CONVERGED, Outcome.SLIDING}
    assert found.evaluation.energy < landscape.evaluate(state).energy
    assert found.residual.largest <= 1e-8
    np.testing.assert_array_equal(found.state.cell, state.cell)


@EVERY
def test_a_packing_at_an_energy_keeps_its_form_of_box_and_its_digits(case, tmp_path, measured):
    landscape, found = minimum(case)
    measured(residual=found.residual.largest)
    assert found.evaluation.energy / found.state.volume == close_to(U0, 1e-6)
    packing = found.state.packing(landscape.particles)
    before = tilted(case).box
    np.testing.assert_allclose(packing.box.tilt_factors, before.tilt_factors, rtol=4 * EPS)
    assert packing.tilt_rest.any()
    write_packing(tmp_path / "tilted.h5", packing)
    again = read_packing(tmp_path / "tilted.h5")
    for one, other in zip(again.poses(), packing.poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    energy = landscape.evaluate(State.of(again)).energy
    assert energy == close_to(landscape.evaluate(found.state).energy, 1e-12)


@EVERY
def test_translations_are_the_zero_modes(case, measured):
    landscape, found = minimum(case)
    matrix = dynamical_matrix(landscape, found.state)
    modes = spectrum(matrix)
    counts = count(matrix, modes)
    measured(rank=counts.rank, floppy=counts.n_floppy)
    assert counts.n_translations == case.dimension
    assert counts.n_modes == counts.n_translations + counts.n_floppy + counts.rank
    assert (modes.sign[~modes.is_translation] > 0).mean() > 0.5


@EVERY
def test_moduli_do_not_depend_on_the_cell(case):
    landscape, found = minimum(case)
    packing = found.state.packing(landscape.particles)
    whole = np.eye(case.dimension)
    whole[0, 1] = -1.0
    matrix = found.state.cell @ whole
    other = packing.with_poses(*packing.poses()[:2], matrix)
    one, same = (
        moduli(dynamical_matrix(Landscape(x, sides=SIDES), State.of(x))) for x in (packing, other)
    )
    assert not np.array_equal(other.box.tilt, packing.box.tilt)
    for name in ("bulk", "pure_shear", "simple_shear"):
        own, other = getattr(one, name), getattr(same, name)
        assert other.affine == close_to(own.affine, 1e-8)
        assert other.relaxed == pytest.approx(own.relaxed, rel=1e-3, abs=1e-6 * own.affine)


@PLANE
def test_slow_compression_shrinks_the_box_in_its_form(case):
    start = tilted(case)
    landscape = Landscape(start, sides=SIDES)
    loose = State.of(start).strained(0.02)
    flow, strain = Flow(loose), 0.005
    phi = loose.packing(start).phi
    protocol = Protocol(1e-4, phi * math.exp(2 * strain))
    steps = list(implicit.compress(landscape, flow, protocol))
    assert steps[-1].pressure > 0
    np.testing.assert_allclose(
        np.float64(flow.state.cell / math.exp(-strain)), np.float64(loose.cell), rtol=1e-12
    )


@PLANE
def test_slow_compression_does_not_depend_on_the_cell(case):
    """The same lattice in an orthogonal cell and in one with a tilt of a whole edge."""
    start = squeezed(case)
    whole = np.array([[1.0, 1.0], [0.0, 1.0]])
    other = start.with_(box=Box.of(start.box.lo, start.box.matrix @ whole))
    ends = []
    for packing in (start, other):
        loose = State.of(packing).strained(0.01)
        flow, phi = Flow(loose), loose.packing(packing).phi
        protocol = Protocol(1e-4, phi * math.exp(0.01), tolerance=1e-5)
        steps = list(implicit.compress(Landscape(packing, sides=SIDES), flow, protocol))
        ends.append(steps[-1])
    assert ends[1].pressure == close_to(ends[0].pressure, 1e-4)


@PLANE
def test_monte_carlo_refuses_a_tilt(case):
    packing = scattered(case, 12, phi=0.06)
    packing = packing.with_(box=Box(packing.box.lo, packing.box.edges, [0.1]))
    with pytest.raises(ValueError, match=r"the box has the tilt \[0.1\], expected none"):
        next(equilibrate(Thermal(packing), 10, 1))


@pytest.mark.lammps
@EVERY
@pytest.mark.parametrize("strength", [1.0, -2.4])
def test_lammps_takes_the_box_and_gives_it_back(case, strength):
    """Also tilts of more than half an edge, which LAMMPS warns of."""
    packing = tilted(case)
    packing = packing.with_(box=Box(packing.box.lo, packing.box.edges, strength * packing.box.tilt))
    inside, turns = packing.box.wrapped(packing.position)
    packing = packing.with_(position=packing.box.lo + inside, image=packing.image + turns)
    with Session() as session:
        session.load(packing)
        found = session.packing()
    np.testing.assert_allclose(found.box.matrix, packing.box.matrix, rtol=4 * EPS)
    expected = packing.sorted_by_id()
    size = 8 * EPS * np.abs(packing.box.bounds).max()
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=size)
    np.testing.assert_array_equal(found.image, expected.image)
