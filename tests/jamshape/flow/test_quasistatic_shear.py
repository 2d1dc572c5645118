"""Quasistatic shear: moduli, energies, what is held, and files."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from small_packings import jammed

import jamshape as js
from jamshape.flow.quasistatic import QuasistaticShear, Sheared, shear
from jamshape.landscape import Landscape, State
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix

# Of few particles at this energy moduli are those of the Hessian over strains of 1e-8.
U0 = 1e-6


def rows_of(name, **how):
    landscape, found = jammed(name, U0)
    return list(shear(landscape, Sheared(found.state), QuasistaticShear(**how)))


@pytest.mark.parametrize("name", ["discs", "rods of alpha 1"])
def test_the_first_step_has_the_shear_modulus_of_the_hessian(name, measured):
    landscape, found = jammed(name, U0)
    known = moduli(dynamical_matrix(landscape, found.state))
    step = 1e-9
    for flow, modulus, of_strain in (
        ("simple", known.simple_shear, 1),
        ("pure", known.pure_shear, 4),
    ):
        rows = rows_of(name, strain_step=step, strain_end=step, flow=flow, tolerance=1e-10)
        slope = (rows[1].stress - rows[0].stress) / step
        measured(**{flow: slope / (of_strain * modulus.relaxed) - 1})
        assert slope == pytest.approx(of_strain * modulus.relaxed, rel=2e-3)


def test_small_steps_lose_no_energy():
    """Without rearrangements the work of the stress is stored: the rest falls as the cube of the step."""
    rows = rows_of("discs", strain_step=1e-6, strain_end=1e-5, tolerance=1e-10)
    gained = rows[-1].u - rows[0].u
    work = 0.5 * sum((a.stress + b.stress) * 1e-6 for a, b in pairwise(rows))
    assert gained == pytest.approx(work, rel=1e-6)
    assert sum(row.lost for row in rows) == pytest.approx(work - gained, abs=1e-6 * abs(work))


def test_small_steps_at_constant_pressure_lose_no_energy():
    """The work includes that of the pressure on the box."""
    pressure = rows_of("discs", strain_step=1e-6, strain_end=1e-6)[0].pressure
    rows = rows_of(
        "discs", strain_step=1e-6, strain_end=1e-5, tolerance=1e-10, hold_pressure=pressure
    )
    by_pressure = sum(
        0.5 * (a.pressure + b.pressure) * abs(b.phi - a.phi) / a.phi for a, b in pairwise(rows)
    )
    assert by_pressure > 0
    assert abs(sum(row.lost for row in rows)) < 1e-3 * by_pressure


def test_the_stress_is_that_of_finite_differences_of_the_energy():
    landscape, found = jammed("rods of alpha 4", U0)
    strain = 1e-8
    for flow in ("simple", "pure"):
        how = QuasistaticShear(flow=flow)
        up, down = (
            landscape.evaluate(found.state.deformed(how.gradient(2, s))).energy
            for s in (strain, -strain)
        )
        expected = (up - down) / (2 * strain * found.state.volume)
        assert how.resisted(landscape.stress(found.state)) == pytest.approx(expected, rel=1e-5)


def test_the_volume_is_held_and_every_step_is_a_minimum():
    rows = rows_of("rods of alpha 1", strain_step=2e-3, strain_end=0.1)
    assert len(rows) == 51
    np.testing.assert_allclose([row.phi for row in rows], rows[0].phi, rtol=1e-13)
    assert max(row.residual for row in rows if row.u > 1e-20) < 1e-6
    assert rows[-1].strain == pytest.approx(0.1, rel=1e-12)


def test_the_pressure_is_held():
    rows = rows_of("rods of alpha 1", strain_step=2e-3, strain_end=0.06, hold_pressure=1e-3)
    np.testing.assert_allclose([row.pressure for row in rows], 1e-3, rtol=1.1e-6)
    assert len({row.phi for row in rows}) > 20


def test_a_box_with_the_least_tilt_is_the_same_packing():
    found = jammed("rods of alpha 4", U0)[1]
    cell = found.state.cell.copy()
    cell[:, 1] += 7 * cell[:, 0]
    least = replace(found.state, cell=cell).with_least_tilt()
    np.testing.assert_allclose(least.cell, found.state.cell, rtol=1e-17)
    bodies = random_packing(8, 0.1, 1, js.Superellipsoids(w1=0.6), 3)
    cell = State.of(bodies).cell @ np.array([[1, 0.3, 0.2], [0, 1, -0.4], [0, 0, 1]])
    far = cell @ np.array([[1, 3, -8], [0, 1, 5], [0, 0, 1]])
    found = replace(State.of(bodies), cell=far).with_least_tilt()
    np.testing.assert_allclose(found.cell, cell, rtol=1e-14)


def test_spheroids_in_space_shear(measured):
    bodies = js.Superellipsoids(w1=0.6)
    start = random_packing(8, 0.2, 2, bodies, 3)
    landscape = Landscape(start)
    state = compressed_to(landscape, State.of(start), 0.8, 0.02)
    rows = list(shear(landscape, Sheared(state), QuasistaticShear(2e-3, 0.04)))
    np.testing.assert_allclose([row.phi for row in rows], 0.8, rtol=1e-12)
    measured(stress=rows[-1].stress)
    assert rows[0].pressure > 0
    assert rows[-1].stress > rows[0].stress


@pytest.fixture
def run(tmp_path):
    landscape, found = jammed("discs", U0)
    start = found.state.packing(landscape.particles)
    file = tmp_path / "run.h5"
    return js.quasistatic_shear(
        start=start, step=2e-3, strain=0.06, frames=6, file=file, progress=False
    )


def test_a_file_has_a_row_for_each_step_and_frames_between(run):
    assert len(run.strain) == 31
    times = [0, 0, 0.01, 0.02, 0.03, 0.04, 0.05, 0.06]  # the start, and its minimum
    assert [frame.time for frame in run] == pytest.approx(times)


def test_drops_of_the_stress_are_listed(run):
    fallen = -np.minimum(np.diff(run.stress), 0).sum()
    events = run.events(least=0.0)
    assert sum(event.drop for event in events) == pytest.approx(fallen, rel=1e-12)
    assert len(run.events(least=0.5)) < len(events)


def test_wrong_numbers_are_refused():
    for numbers, words in (
        ({"strain_step": 0.2, "strain_end": 0.1}, "expected at most the final strain"),
        ({"hold_pressure": -1.0}, "expected a positive number"),
        ({"flow": "none"}, "expected one of simple, pure"),
    ):
        with pytest.raises(ValueError, match=words):
            QuasistaticShear(**numbers)


# --- either direction, and cycles -----------------------------------------------------------------


def aqs_of(tmp_path, name="discs", **settings):
    landscape, found = jammed(name, U0)
    start = found.state.packing(landscape.particles)
    given = {"start": start, "file": tmp_path / "run.h5", "progress": False} | settings
    return js.quasistatic_shear(**given)


def test_a_negative_strain_is_the_mirror_image():
    landscape, found = jammed("discs", U0)
    flip = np.array([-1, 1], np.longdouble)
    mirrored = replace(found.state, position=found.state.position * flip)
    how = {"strain_step": 1e-3, "tolerance": 1e-10}
    one = list(shear(landscape, Sheared(found.state), QuasistaticShear(strain_end=-0.01, **how)))
    other = list(shear(landscape, Sheared(mirrored), QuasistaticShear(strain_end=0.01, **how)))
    assert [row.strain for row in one] == [-row.strain for row in other]
    np.testing.assert_allclose([r.u for r in one], [r.u for r in other], rtol=1e-6)
    scale = max(abs(row.stress) for row in other)
    np.testing.assert_allclose(
        [r.stress for r in one], [-r.stress for r in other], atol=1e-6 * scale
    )
    lost = [row.lost for row in one]
    np.testing.assert_allclose(lost, [r.lost for r in other], atol=1e-6 * max(map(abs, lost)))


def test_drops_in_the_other_direction_are_listed(tmp_path):
    run = aqs_of(tmp_path, step=2e-3, strain=-0.06)
    assert run.strain[-1] == pytest.approx(-0.06)
    risen = np.maximum(np.diff(run.stress), 0).sum()
    assert sum(event.drop for event in run.events(least=0.0)) == pytest.approx(risen, rel=1e-12)
    assert run.steady(after=0.01).strain == pytest.approx(0.06)
    assert run.plot().get_xlim() == pytest.approx((-0.06, 0))


def test_cycles_are_a_triangle_wave_that_ends_in_the_box_of_the_start(tmp_path):
    run = aqs_of(tmp_path, step=3e-3, amplitude=0.01, cycles=2)
    quarter = np.array([0, 0.0025, 0.005, 0.0075, 0.01])
    cycle = np.concatenate([quarter, quarter[-2::-1], -quarter[1:], -quarter[-2::-1]])
    np.testing.assert_allclose(run.strain, np.concatenate([cycle, cycle[1:]]), atol=1e-18)
    assert run.steps_per_cycle == 16
    at = [frame.time for frame in run]
    assert min(at) == -0.01
    assert max(at) == 0.01
    first, last = run.packing(0).box, run.packing(-1).box
    np.testing.assert_allclose(last.matrix, first.matrix, atol=1e-15 * first.edges.max())
    assert run.at_rest.all()
    assert {"cycle 1", "cycle 2"} <= {line.get_label() for line in run.plot().lines}
    with pytest.raises(ValueError, match="the shear has 2 cycles, expected one strain"):
        run.steady()


def test_a_reversible_cycle_loses_no_energy(tmp_path):
    run = aqs_of(tmp_path, step=1e-6, amplitude=1e-5, tolerance=1e-11)
    ends = run.stress[:: run.steps_per_cycle]
    stored = np.abs(run["u"] - run["u"][0]).max()
    assert ends[1] == pytest.approx(ends[0], abs=1e-4 * np.abs(run.stress - ends[0]).max())
    assert abs(run["lost"].sum()) < 1e-4 * stored


def test_cycles_far_beyond_half_an_edge_return_to_the_box(tmp_path):
    run = aqs_of(tmp_path, step=0.1, amplitude=0.8)
    first, last = run.packing(0).box, run.packing(-1).box
    np.testing.assert_allclose(last.matrix, first.matrix, atol=1e-14 * first.edges.max())


def test_a_frame_in_a_tilted_box_is_a_new_zero(tmp_path):
    whole = aqs_of(tmp_path, step=1e-4, strain=0.02, frames=2, tolerance=1e-11)
    half = whole.packing(2)
    assert 0 < half.time < 0.02
    assert half.box.is_tilted
    rest = 0.02 - half.time
    run = js.quasistatic_shear(
        start=half, step=1e-4, strain=rest, tolerance=1e-11, file=tmp_path / "on.h5", progress=False
    )
    assert run.strain[0] == 0.0
    assert [run.packing(0).time, run.packing(0).step] == [0.0, 0]
    np.testing.assert_array_equal(run.packing(0).box.matrix, half.box.matrix)
    tail = whole.stress[-len(run.stress) :]
    np.testing.assert_allclose(run.stress, tail, atol=1e-7 * np.abs(tail).max())  # it unjams
    back = js.quasistatic_shear(start=whole.packing(1), strain=-0.002, step=1e-3, progress=False)
    assert back.strain.tolist() == [0, -0.001, -0.002]


def test_cycles_and_a_strain_exclude_each_other():
    discs = js.Spherocylinders(alpha=0)
    for given, words in (
        ({"amplitude": 0.1, "strain": 0.1}, "strain=0.1 has no effect with amplitude=0.1"),
        ({"cycles": 3}, "cycles=3 has no effect without amplitude"),
        ({"amplitude": 1e-4}, "expected at most the amplitude, 0.0001"),
        ({"strain": 0.0}, "strain_end is 0.0"),
        ({"amplitude": 5.0, "flow": "pure"}, "amplitude is 5.0"),
    ):
        with pytest.raises(ValueError, match=words):
            js.quasistatic_shear(discs, n=8, progress=False, **given)
