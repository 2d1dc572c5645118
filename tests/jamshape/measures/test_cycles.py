"""Cycles: moduli and work of elements in closed form, distances of known motions, and runs that return or do not."""

import numpy as np
import pytest
from small_packings import jammed

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.commands.contents import contents_of
from jamshape.commands.info import lines_of
from jamshape.measures.contact_changes import At
from jamshape.measures.cycles import distance, moduli_of, work_of
from jamshape.packing import State

AMPLITUDE, PERIOD, G = 0.02, 50.0, 3.0
OMEGA, RATE = 2 * np.pi / PERIOD, 4 * AMPLITUDE / PERIOD


def times(n):
    return np.linspace(0, PERIOD, n + 1)


def wave(n):
    phase = np.linspace(0, 4, n + 1)
    return AMPLITUDE * np.interp(phase, [0, 1, 3, 4], [0, 1, -1, 0])


def maxwell(n, tau):
    """Steady stress of a spring and a dashpot in series under the wave: an exponential in each half, odd from half to half."""
    since = (times(n) + PERIOD / 4) % (PERIOD / 2)
    sign = np.where((times(n) + PERIOD / 4) % PERIOD < PERIOD / 2, 1, -1)
    return (
        sign * G * tau * RATE
        * (1 - 2 * np.exp(-since / tau) / (1 + np.exp(-PERIOD / (2 * tau))))
    )  # fmt: skip


def test_a_spring_stores_everything():
    strain = wave(40)
    found = moduli_of(strain, G * strain + 0.1)  # a stress at rest does not matter
    assert found.storage == pytest.approx(G, rel=1e-14)
    assert abs(found.loss) < 1e-14 * G
    assert abs(work_of(strain, G * strain + 0.1)) < 1e-17


def test_a_dashpot_loses_everything():
    """Half way between rows that meet at a turn its stress is 0; G'' is viscosity times frequency."""
    n, viscosity = 4000, 7.0
    turns = np.isin(np.arange(n + 1) % (n // 2), [n // 4])
    rising = np.where((np.arange(n + 1) < n // 4) | (np.arange(n + 1) > 3 * n // 4), 1, -1)
    stress = viscosity * RATE * np.where(turns, 0, rising)
    found = moduli_of(wave(n), stress)
    assert found.loss == pytest.approx(viscosity * OMEGA, rel=1e-5)
    assert abs(found.storage) < 1e-12 * found.loss
    assert work_of(wave(n), stress) == pytest.approx(viscosity * RATE**2 * PERIOD, rel=2e-3)


@pytest.mark.parametrize("tau", [0.5, 8.0, 300.0])
def test_a_maxwell_element_has_its_moduli_and_its_work(tau, measured):
    known = G * 1j * OMEGA * tau / (1 + 1j * OMEGA * tau)
    work = G * tau * RATE**2 * (PERIOD - 4 * tau * np.tanh(PERIOD / (4 * tau)))
    errors = []
    for n in (400, 800):
        strain, stress = wave(n), maxwell(n, tau)
        errors.append(abs(complex(*moduli_of(strain, stress)) / known - 1))
        assert work_of(strain, stress) == pytest.approx(work, rel=(20 + (PERIOD / tau) ** 2) / n**2)
    measured(coarse=errors[0], fine=errors[1])
    assert errors[1] < 1e-3
    assert errors[1] < 0.3 * errors[0]


# --- distances ------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rods():
    landscape, found = jammed("rods of alpha 1", 1e-6)
    return found.state.packing(landscape.particles)


def test_a_packing_in_another_order_box_and_place_is_the_same(rods):
    strained = State.of(rods).strained(0.01).packing(rods)
    box = strained.box
    cell = box.matrix.copy()
    cell[:, 1] += cell[:, 0]
    turned = strained.orientation + np.pi * (np.arange(rods.n) % 2)
    order = np.roll(np.arange(rods.n), 3)
    other = strained.with_(
        position=strained.position + [0.3, -0.2] + 2 * cell[:, 0], orientation=turned,
        box=js.Box.of(box.lo, cell),
    )  # fmt: skip
    names = ("position", "orientation", "diameters", "exponent", "species", "id", "image")
    other = other.with_(**{name: getattr(other, name)[order] for name in names})
    found = distance(rods, other, rattlers=True)
    assert found.largest < 1e-12
    assert found.changed == len(At(0.0, rods).bonds ^ At(0.0, other).bonds)


def test_moved_and_turned_particles_are_as_far_as_they_moved(rods):
    n, size = rods.n, rods.inner_radius.min()
    position, orientation = rods.position.copy(), rods.orientation.copy()
    position[2] += [3e-4, -4e-4]
    orientation[5] += 1e-3
    found = distance(rods, rods.with_(position=position, orientation=orientation), rattlers=True)
    tip = 2 * np.sin(5e-4) * (rods.outer_radius - rods.inner_radius)[5]
    mean = np.array([3e-4, -4e-4]) / n
    squared = np.full(n, mean @ mean)
    squared[2] = ((np.array([3e-4, -4e-4]) - mean) ** 2).sum()
    squared[5] += tip**2
    assert found.largest == pytest.approx(np.sqrt(squared.max()) / size, rel=1e-9)
    assert found.rms == pytest.approx(np.sqrt(squared.mean()) / size, rel=1e-9)


def test_a_spheroid_may_spin_about_its_axis_but_not_turn():
    bodies = js.make_packing(js.Superellipsoids(w1=0.6), n=8, dimension=3, u0=1e-4, progress=False)
    (axis,) = set(bodies.symmetry_axis.tolist())
    for k in range(3):
        spin = np.zeros(4)
        spin[[0, 1 + k]] = np.cos(5e-4), np.sin(5e-4)
        turned = bodies.with_(orientation=np.array([_product(q, spin) for q in bodies.orientation]))
        found = distance(bodies, turned, rattlers=True)
        lever = (bodies.outer_radius - bodies.inner_radius).max() / bodies.inner_radius.min()
        assert found.largest == pytest.approx(0 if k == axis else 1e-3 * lever, abs=1e-6 * lever)


def _product(a, b):
    """Rotation by b in the body's frame, then a; quaternions w i j k."""
    w, v = a[0] * b[0] - a[1:] @ b[1:], a[0] * b[1:] + b[0] * a[1:] + np.cross(a[1:], b[1:])
    return np.array([w, *v])


def test_rattlers_count_on_request_alone():
    discs = js.make_packing(js.Spherocylinders(alpha=0), n=64, u0=1e-8, progress=False)
    loose = np.flatnonzero(discs.rattlers)
    assert len(loose) > 0
    position = discs.position.copy()
    position[loose[0]] += 1e-3
    moved = discs.with_(position=position)
    assert distance(discs, moved, rattlers=False).largest < 1e-12
    assert distance(discs, moved, rattlers=True).largest > 1e-3


# --- runs -----------------------------------------------------------------------------------------


def aqs(tmp_path, name="discs", **how):
    landscape, found = jammed(name, 1e-6)
    start = found.state.packing(landscape.particles)
    given = {"start": start, "file": tmp_path / "a.h5", "progress": False, "tolerance": 1e-10}
    return js.quasistatic_shear(**given | how)


def test_a_small_quasistatic_cycle_returns_and_a_large_one_does_not(tmp_path, measured):
    small = aqs(tmp_path, step=1e-5, amplitude=1e-4, cycles=2)
    modulus = js.modes(small.packing(1)).moduli.simple_shear.relaxed
    assert [cycle.number for cycle in small.cycles()] == [1, 2]
    assert [cycle.number for cycle in small.cycles(first=-1)] == [2]
    for cycle in small.cycles():
        assert cycle.is_reversible
        assert cycle.changed == 0
        assert cycle.storage == pytest.approx(modulus, rel=1e-2)
        assert abs(cycle.loss) < 1e-6 * modulus
        assert abs(cycle.lost) < 1e-6 * modulus * 1e-8
        measured(largest=cycle.largest, storage=cycle.storage / modulus - 1)
    large = aqs(tmp_path, step=5e-3, amplitude=0.1, cycles=1, again=True)
    (cycle,) = large.cycles()
    assert not cycle.is_reversible
    assert cycle.changed > 0
    assert cycle.loss > 0
    assert cycle.lost == pytest.approx(large["lost"][1:].sum(), rel=1e-14)
    assert large.cycles(tolerance=1e3)[0].is_reversible
    found = contents_of(large.file)
    assert found["last_cycle"] == cycle._asdict()
    assert any("not reversible: particles within" in line for line in lines_of(found))


def test_work_of_a_quasistatic_cycle_is_lost_or_stored(tmp_path):
    run = aqs(tmp_path, step=2e-3, amplitude=0.04, cycles=2)
    per_cycle = run.steps_per_cycle
    for cycle in run.cycles():
        ends = run["u"][[(cycle.number - 1) * per_cycle, cycle.number * per_cycle]]
        assert cycle.work - cycle.lost == pytest.approx(np.diff(ends)[0], abs=1e-9 * cycle.work)


def test_only_whole_cycles_of_an_unfinished_run_count(tmp_path):
    given = {"step": 1e-3, "amplitude": 1e-3}
    with pytest.raises(TimeLimitError):
        aqs(tmp_path, seconds=0.5, cycles=10_000, **given)
    part = js.load(tmp_path / "a.h5")
    cycles = part.cycles()
    assert len(cycles) == (len(part.strain) - 1) // 4
    one = aqs(tmp_path, cycles=1, again=True, **given)
    assert cycles[:1] == one.cycles()[: len(cycles)]


def test_only_whole_cycles_count_and_a_strain_has_none(tmp_path):
    assert aqs(tmp_path, step=1e-3, strain=4e-3).cycles() == []
    with pytest.raises(ValueError, match="tolerance is 0, expected a positive number"):
        aqs(tmp_path, step=1e-3, strain=4e-3).cycles(tolerance=0)


def test_a_cycle_at_constant_pressure_is_compared_beside_its_volume(tmp_path):
    run = aqs(tmp_path, step=2e-5, amplitude=1e-4, pressure=1e-3)
    (cycle,) = run.cycles()
    assert np.ptp(run.phi) > 0
    assert cycle.is_reversible
    assert cycle.storage == pytest.approx(run.modulus(), rel=1e-2)  # it falls with the strain


@pytest.mark.lammps
def test_work_at_a_rate_is_dissipated_or_stored(tmp_path, measured):
    """Discs: no power of torques of the host."""
    run = js.cyclic_shear(
        js.Spherocylinders(alpha=0), n=16, phi=0.86, amplitude=0.02, period=80, cycles=2, rows=400,
        dt=0.05, file=tmp_path / "a.h5", progress=False,
    )  # fmt: skip
    cycles = run.cycles()
    assert len(cycles) == 2
    for cycle in cycles:
        stored = run["u"][400 * cycle.number] - run["u"][400 * (cycle.number - 1)]
        measured(balance=(cycle.work - cycle.lost - stored) / cycle.lost)
        assert cycle.work - cycle.lost == pytest.approx(stored, abs=2e-3 * cycle.lost)
        ends = [run.packing(cycle.number - k) for k in (1, 0)]
        first, last = (one.position + one.image @ one.box.matrix.T for one in ends)
        moved = last - first - (last - first).mean(axis=0)
        rms = np.sqrt((moved**2).sum(axis=1).mean()) / ends[0].inner_radius.min()
        assert cycle.rms == pytest.approx(rms, rel=1e-9)
        assert cycle.loss > 0
        assert cycle.storage > 0


@pytest.mark.lammps
def test_states_that_were_not_kept_have_no_distance(tmp_path):
    run = js.cyclic_shear(
        js.Spherocylinders(alpha=0), n=8, phi=0.7, amplitude=0.02, period=40, cycles=5, frames=2, rows=20,
        file=tmp_path / "a.h5", progress=False,
    )  # fmt: skip
    found = [cycle.is_reversible for cycle in run.cycles()]
    assert [one is None for one in found] == [True, True, True, True, False]
    assert np.isnan(run.cycles()[0].largest)
