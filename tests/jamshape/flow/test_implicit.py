import numpy as np
import pytest
from scipy.integrate import solve_ivp
from squeezed import quickly_squeezed

from jamshape.flow import implicit as stiff_compression
from jamshape.flow.implicit import METHODS, Flow, Protocol, Step, compress, drag_coefficients
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.minima import minimise
from jamshape.packing import Box, Packing


def packing_of(alpha, position, angle, L=10.0):
    n = len(position)
    diameters = np.tile([1.0 + alpha, 1.0, 1.0], (n, 1))
    return Packing(
        box=Box(np.zeros(2), np.full(2, L)),
        position=np.asarray(position, float),
        orientation=np.asarray(angle, float),
        diameters=diameters,
        species=np.ones(n, int),
        id=np.arange(1, n + 1),
    )


def two(alpha=0.0, turned=0.0, overlap=0.02):
    """Two particles side by side on x: discs, or upright rods of which one may be turned."""
    angle = [np.pi / 2, np.pi / 2 + turned]
    return packing_of(alpha, [[4.0, 5.0], [5.0 - overlap, 5.0]], angle)


def ended(packing, protocol, **fields):
    landscape, flow = Landscape(packing), Flow(State.of(packing), **fields)
    steps = list(compress(landscape, flow, protocol))
    return landscape, flow, steps


def reference(packing, kappa, phi_end):
    """Coordinates in the box of the start, by an implicit method of high order with tight tolerances."""
    landscape, start = Landscape(packing), State.of(packing)
    drag = drag_coefficients(landscape)

    def stretch_of(strain):
        return 1.0 + landscape.coordinates(np.tile([strain, strain, 0.0], (packing.n, 1)))

    def velocity(t, x):
        strain = np.expm1(-kappa * t)
        found = landscape.evaluate(landscape.displaced(start, x).strained(strain))
        return -found.gradient / (stretch_of(strain) * drag)

    def jacobian(t, x):
        strain = np.expm1(-kappa * t)
        hessian = landscape.curvature(landscape.displaced(start, x).strained(strain)).hessian
        stretch = stretch_of(strain)
        return -(hessian.toarray() * stretch) / (stretch * drag)[:, None]

    end = 0.5 * np.log(phi_end / packing.phi) / kappa
    found = solve_ivp(
        velocity, (0, end), np.zeros(landscape.size), "Radau", jac=jacobian, rtol=1e-7, atol=1e-10
    )
    strain = np.expm1(-kappa * end)
    return landscape.evaluate(landscape.displaced(start, found.y[:, -1]).strained(strain))


def pressure(evaluation, phi, packing):
    return -evaluation.strain_gradient / (2 * packing.measures.sum() / phi)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("alpha", [0.0, 4.0])
def test_two_overlapping_particles_relax_as_in_closed_form(method, alpha, monkeypatch):
    monkeypatch.setattr(stiff_compression, "_EXPLICIT_BELOW", 0.0)
    # d(overlap)/dt = kappa - 2 F / (k_d Area), F = overlap / d.
    packing = two(alpha)
    area = packing.measures[0]
    end, kappa, errors = 2.0, 1e-6, []
    phi_end = packing.phi * np.exp(2 * kappa * end)
    bonds = 1 if alpha == 0 else 2
    rate = 2 * bonds / area
    exact = 0.02 * np.exp(-rate * end) - kappa / rate * np.expm1(-rate * end)
    for n in (16, 32, 64):
        protocol = Protocol(
            kappa, phi_end, tolerance=1e9, largest_strain=kappa * end / n, method=method
        )
        _, flow, steps = ended(packing, protocol, dt=end / n)
        assert [s.dt for s in steps] == pytest.approx([end / n] * n, rel=1e-4)
        x = flow.state.position[:, 0] / flow.state.edges[0]
        errors.append(abs((1 - float((x[1] - x[0]) * flow.state.edges[0])) / exact - 1))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.25)
    assert errors[-1] < 2e-3


@pytest.mark.parametrize("method", METHODS)
def test_huge_steps_land_on_the_quasistatic_minimum(method):
    packing, state = quickly_squeezed(12, 4, 0.95)
    landscape = Landscape(packing)
    state = minimise(landscape, state).state
    start = state.packing(packing)
    phi_end = start.phi * (1 + 1e-8)
    protocol = Protocol(1e-14, phi_end, tolerance=1e-6, method=method)
    landscape, flow, steps = ended(start, protocol, dt=1e12)
    exact = minimise(landscape, flow.state)
    assert len(steps) <= 3
    assert steps[-1].u == pytest.approx(exact.energy_density, rel=1e-10)
    assert steps[-1].dt > 1e5


@pytest.fixture(scope="module")
def jamming():
    """Twelve rods a little below jamming."""
    packing, state = quickly_squeezed(12, 4, 0.8)
    return state.packing(packing)


def test_power_balances(jamming):
    # dU/dt = 2 kappa p L^2 - sum F^2/(k_d Area) - sum tau^2/(k_d Area I), integrated by trapezoids.
    kappa, k_d = 1e-3, 2.0
    landscape, flow = Landscape(jamming), Flow(State.of(jamming))
    drag = drag_coefficients(landscape, k_d)
    protocol = Protocol(kappa, 0.87, tolerance=1e-4, k_d=k_d, largest_strain=5e-5)
    energy, power, times = [], [], []
    for step in compress(landscape, flow, protocol):
        found = landscape.evaluate(flow.state)
        work = -kappa * found.strain_gradient  # 2 kappa p L^2
        assert work == pytest.approx(2 * kappa * step.pressure * flow.state.volume, rel=1e-2)
        energy.append(found.energy)
        power.append(work - float((found.gradient**2 / drag).sum()))
        times.append(step.time)
    gained = np.trapezoid(power, times)
    assert gained == pytest.approx(energy[-1] - energy[0], rel=2e-3)
    assert energy[-1] > 2 * energy[0]


@pytest.mark.parametrize(("alpha", "phi"), [(0, 0.8), (0.01, 0.8), (4, 0.83)])
def test_pressure_is_that_of_radau_through_contacts_that_open_and_close(alpha, phi):
    packing, state = quickly_squeezed(8, alpha, phi)
    start, kappa = state.packing(packing), 1e-4
    phi_end = start.phi * 1.02
    exact = pressure(reference(start, kappa, phi_end), phi_end, start)
    errors = []
    for tolerance in (1e-2, 1e-4):
        landscape, flow, steps = ended(start, Protocol(kappa, phi_end, tolerance=tolerance))
        found = pressure(landscape.evaluate(flow.state), phi_end, start)
        assert steps[-1].pressure == pytest.approx(found, rel=10 * tolerance)
        errors.append(abs(found / exact - 1))
    assert errors[0] < 3e-2
    assert errors[1] < 3e-4
    bonds = Landscape(start).evaluate(State.of(start)).n_bonds
    assert landscape.evaluate(flow.state).n_bonds != bonds or alpha == 0.01


def test_work_hardly_depends_on_the_rate():
    packing, state = quickly_squeezed(16, 4, 0.95)
    start = minimise(Landscape(packing), state).state.packing(packing)
    phi_end = start.phi * 1.002
    evaluations = []
    for kappa in (1e-6, 1e-9, 1e-12):
        _, flow, _ = ended(start, Protocol(kappa, phi_end, tolerance=1e-3))
        evaluations.append(flow.evaluations)
    assert max(evaluations) < 5 * min(evaluations)
    assert max(evaluations) < 3000


def largest_drop(steps):
    """Part of the energy that a step loses; where there are more than the contacts of a flow."""
    energy = np.array([step.u / step.phi for step in steps])
    before, after = energy[:-1], energy[1:]
    return (1 - after / np.maximum(before, 1e-9))[before > 1e-9].max()


def test_plastic_events_are_resolved_in_time_where_asked(jamming):
    # kappa 1e-8: an event takes as long as particles relax, and steps go over it.
    whole, resolved = (
        ended(jamming, Protocol(1e-8, 0.9, tolerance=1e-2, largest_drop=drop))[2]
        for drop in (np.inf, 0.05)
    )
    assert largest_drop(whole) > 0.3
    # A row's energy is that of the last evaluation, a correction away from the step's end.
    assert largest_drop(resolved) < 0.0505
    assert len(resolved) > len(whole)
    assert resolved[-1].pressure == pytest.approx(whole[-1].pressure, rel=1e-2)


def test_going_on_from_between_two_steps_gives_the_same_to_the_bit(jamming):
    protocol = Protocol(1e-5, 0.85)
    landscape, flow = Landscape(jamming), Flow(State.of(jamming))
    for step in compress(landscape, flow, protocol):
        if step.step == 20:
            flow.forget()
            fresh = Flow(**{k: v for k, v in vars(flow).items() if not k.startswith("_")})
    rest = list(compress(Landscape(jamming), fresh, protocol))
    assert rest[0].step == 21
    np.testing.assert_array_equal(fresh.state.position, flow.state.position)
    np.testing.assert_array_equal(fresh.state.orientation, flow.state.orientation)
    assert rest[-1].evaluations == flow.evaluations


def test_rates_change_at_their_packing_fractions_and_it_ends_at_a_pressure(jamming):
    protocol = Protocol(((0.0, 1e-4), (0.803, 1e-5)), 1.2, p_end=1e-3)
    _, _, steps = ended(jamming, protocol)
    assert any(abs(step.phi - 0.803) < 1e-12 for step in steps)
    assert steps[-1].pressure >= 1e-3 > steps[-2].pressure
    strain, time = (np.array([getattr(s, k) for s in steps]) for k in ("strain", "time"))
    rates = np.diff(strain) / np.diff(time)
    phi = np.array([step.phi for step in steps])[1:]
    assert rates == pytest.approx(np.where(phi < 0.803 + 1e-9, 1e-4, 1e-5), rel=1e-9)


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ({"kappa": 0.0}, "kappa is 0.0, expected positive rates"),
        ({"kappa": ((0.8, 1e-6), (0.7, 1e-7))}, "expected ascending packing fractions"),
        ({"tolerance": -1.0}, "tolerance is -1.0, expected a positive number"),
        ({"method": "euler"}, "the method is 'euler', expected one of sdirk2, tr-bdf2"),
    ],
)
def test_senseless_numbers_are_refused(numbers, sentence):
    with pytest.raises(ValueError, match=sentence):
        Protocol(**numbers)


def test_steps_are_rows_of_numbers():
    assert Step._fields[:6] == ("step", "time", "strain", "phi", "pressure", "u")


def test_a_rate_that_drives_spines_across_each_other_is_refused():
    packing = packing_of(2.0, [[5.0, 5.0], [5.3, 6.2]], [0.0, 1.5], L=6.0)
    sentence = r"spines of particles 1 and 2 cross at phi = .* kappa = 100, expected .* more slowly"
    with pytest.raises(CrossingError, match=sentence):
        ended(packing, Protocol(1e2, 3.0))


def test_so_is_one_whose_explicit_steps_do():
    """The state of the last step is evaluated anew before an explicit one."""
    before = packing_of(2.0, [[5.0, 5.0], [5.3, 6.2]], [0.0, 1.5], L=6.0)
    crossed = packing_of(2.0, [[5.0, 5.0], [5.3, 5.2]], [0.0, 1.5], L=6.0)
    landscape, flow = Landscape(before), Flow(State.of(crossed), steps=1, explicit_left=1)
    flow._here = landscape.evaluate(State.of(before))
    flow.velocity, flow.dt = np.zeros(landscape.size), 1.0
    with pytest.raises(
        CrossingError, match=r"cross at phi = .* kappa = 0\.01, expected .* more slowly"
    ):
        next(compress(landscape, flow, Protocol(1e-2, 3.0)))
