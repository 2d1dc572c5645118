"""Overdamped flow at any rate, however slow: adaptive, implicit and L-stable.

The motion of Marschall & Teitel 2018, Eqs. 6-13, for compression and shear. In coordinates that move with the host the
affine part is exact, and the remainder is mobility times force: a gradient flow, stiff as soon as particles touch.
Each stage of a step begins where the host alone would take particles, box and angles in its time. Explicit
methods must resolve the relaxation of a contact at any rate; here the step follows the path of the
packing, and its cost hardly depends on the rate. When a packing rearranges, the step falls to the
relaxation time and grows again. Needs no LAMMPS.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import ClassVar, NamedTuple
from typing import Protocol as Proto

import numpy as np

from jamshape.arrays import FloatArray, IntArray, LongArray
from jamshape.checks import require_one_of, require_positive
from jamshape.flow.box_control import Border, BoxControl, Secant, YieldingBox
from jamshape.flow.host import Host, exponential
from jamshape.flow.turning import turning_of
from jamshape.landscape import CrossingError, Evaluation, Landscape, State
from jamshape.landscape.local_energy_model import (
    LocalEnergyModel,
    Solution,
    Stage,
    StageFactors,
    StageKinks,
    Units,
)

# Accuracy of stages, over the allowed local error. A tenfold one would leave velocities on kinks
# that cause rejections: packings of nearly round rods then cost ten times as much.
_STAGE_ACCURACY = 0.003

_LARGEST_GROWTH, _LEAST_GROWTH = 3.0, 0.2  # limits of the change of the step
_SAFETY = 0.85  # fraction of the allowed error to aim at

_RETREAT = 0.25  # change of the step after a stage without a solution
_FALLING = 0.5  # change of the step if the energy falls too far

# Velocities are extrapolated if the acceleration predicted the last change of velocity to this fraction.
_TOLD = 0.5

# Number of steps without growth after a rejected one.
_HELD = 2

# Factors are reused for steps whose size differs by less than this factor.
_SAME_STEP = 1.5

# Tilt above which a box gets other cell vectors.
_LARGEST_TILT = 0.6

# Longest explicit step, in drag over stiffness of a contact. Explicit steps serve where no implicit one is found; at
# the same error they take more evaluations.
_EXPLICIT_BELOW = 1e-3
_EXPLICIT_IN_A_ROW = 20
_LEAST_STEP = 1e-3  # shortest explicit step, over the longest

# Most solutions of a stage in a box that yields, largest strain in a step by its rate at the start, and at the end.
_BOXES = 12
_YIELDED, _OVERSTRAINED = 1e-3, 4e-3

# Spines that cross within this fraction of the times of contacts and of the box cross at any step.
_AT_ONCE = 1e-9

# Extended precision is used if the rounding of doubles exceeds this fraction of the accuracy of a stage.
_ROUNDING = 0.1


class Method(NamedTuple):
    """A diagonally implicit Runge-Kutta method whose last stage is the end of the step."""

    weights: tuple[tuple[float, ...], ...]
    """Lower triangle of the tableau; an explicit stage has 0 on the diagonal."""
    error: tuple[float, ...]
    """Weights of the local error estimate."""
    order_of_error: int

    @property
    def times(self) -> list[float]:
        """Times of the stages, over the step."""
        return [sum(row) for row in self.weights]


_G = 1 - math.sqrt(0.5)
_W = math.sqrt(0.125)

METHODS = {
    # Alexander 1977, SIAM J. Numer. Anal. 14, 1006; embedded method of first order.
    "sdirk2": Method(((_G,), (1 - _G, _G)), (0.5 - _G, _G - 0.5), 2),
    # Hosea & Shampine 1996, Appl. Numer. Math. 20, 21; embedded method of third order.
    "tr-bdf2": Method(((0.0,), (_G, _G), (_W, _W, _G)), ((4 * _W - 1) / 3, -1 / 3, 2 * _G / 3), 3),
}

_HEUN_EULER = Method(((0.0,), (1.0, 0.0), (0.5, 0.5, 0.0)), (-0.5, 0.5, 0.0), 2)


class Leg(NamedTuple):
    """A period of constant host flow."""

    host: Host
    time: float


@dataclass(frozen=True)
class Protocol:
    """Settings of a compression.

    Parameters
    ----------
    kappa
        Rate, dL/dt = -kappa L, [1/time]; or rates with the packing fractions from which they apply,
        ``((phi, kappa), ...)``, ascending in phi.
    phi_end, p_end
        Final packing fraction, and pressure at whose first occurrence it ends.
    tolerance
        Local error of a step over the typical overlap.
    k_d
        Drag, [energy time / length^(D + 2)].
    largest_strain
        Largest strain of the box in a step.
    largest_drop
        Fraction of the elastic energy that a step may lose, which resolves plastic events, where particles move
        spontaneously and the energy falls, in time. Not applied to energies
        below those caused by drag.
    method
        One of `METHODS`.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    kappa: float | tuple[tuple[float, float], ...] = 1e-8
    phi_end: float = 0.9
    p_end: float = math.inf
    tolerance: float = 1e-3
    k_d: float = 1.0
    largest_strain: float = 1e-3
    largest_drop: float = math.inf
    method: str = "tr-bdf2"

    control: ClassVar[BoxControl | None] = None

    def __post_init__(self) -> None:
        names = ("phi_end", "tolerance", "k_d", "largest_strain")
        # Infinite values are not bounds.
        bounds = [name for name in ("p_end", "largest_drop") if getattr(self, name) != math.inf]
        require_positive(**{name: getattr(self, name) for name in (*names, *bounds)})
        self._require_rates()
        require_one_of("the method", self.method, METHODS)

    def _require_rates(self) -> None:
        try:
            phis, rates = zip(*self.rates, strict=True)
            valid = all(math.isfinite(phi) and 0 < rate < math.inf for phi, rate in self.rates)
        except (TypeError, ValueError):
            msg = f"kappa is {self.kappa!r}, expected a rate, or pairs of a packing fraction and a rate"
            raise ValueError(msg) from None
        if not (rates and valid):
            msg = f"kappa is {self.kappa}, expected positive rates"
            raise ValueError(msg)
        if list(phis) != sorted(set(phis)):
            msg = f"kappa is {self.kappa}, expected ascending packing fractions"
            raise ValueError(msg)

    @property
    def rates(self) -> tuple[tuple[float, float], ...]:
        """Packing fractions and the rates that apply from there on."""
        if isinstance(self.kappa, tuple):
            return self.kappa
        return ((0.0, self.kappa),)

    def leg(self, flow: Flow, phi: float) -> Leg:
        """Return the host at a packing fraction, and for how long it applies."""
        dimension = flow.state.dimension
        kappa, end = self._rate_at(phi)
        return Leg(Host.compressing(kappa, dimension), math.log(end / phi) / dimension / kappa)

    def is_over(self, flow: Flow, phi: float) -> bool:
        """Whether the end is reached."""
        del flow
        return phi >= self.phi_end * (1 - 1e-12)

    def measured(self, landscape: Landscape, flow: Flow) -> dict[str, float]:
        """Return measurements beyond a `Step`: none."""
        del landscape, flow
        return {}

    def where(self, phi: float) -> str:
        """Describe the position, for messages."""
        kappa, _ = self._rate_at(phi)
        return f"at phi = {phi:.6g} at the rate kappa = {kappa:g}"

    def _rate_at(self, phi: float) -> tuple[float, float]:
        """Return the rate at phi, and the packing fraction up to which it applies."""
        nearly = phi * (1 + 1e-13)
        kappa = next((rate for start, rate in reversed(self.rates) if start <= nearly),
                     self.rates[0][1])  # fmt: skip
        ends = [start for start, _ in self.rates if start > nearly]
        return kappa, min([*ends, self.phi_end])


@dataclass(eq=False)
class Flow:
    """State of a flow between two steps, with all that is needed to resume it.

    Parameters
    ----------
    state : State
    dt : float, [time]
        Next step; 0 to choose one.
    velocity : (n,) array, [length / time]
        Nonaffine velocity at the end of the last step, in the coordinates of the landscape, and that of
        a box that yields; empty to compute it.
    acceleration : (n,) array, [length / time^2]
        Its change over the last step; both are only predictors, unless the method has an explicit stage.
    """

    state: State
    dt: float = 0.0
    velocity: FloatArray = field(default_factory=lambda: np.empty(0))
    acceleration: FloatArray = field(default_factory=lambda: np.empty(0))
    time: float = 0.0
    strain: float = 0.0
    """Strain of the box since the start, -ln L / L_0 in compression."""
    turned: float = 0.0
    """Mean rotation angle of particles since the start, in space about z."""
    steps: int = 0
    rejected: int = 0
    explicit: int = 0
    evaluations: int = 0
    factorisations: int = 0
    wall_seconds: float = 0.0
    explicit_left: int = 0
    held: int = 0
    """Number of steps before growth is allowed again."""
    extrapolates: int = 1
    """Whether velocities are extrapolated, as the acceleration predicted the last one."""
    _factors: StageFactors | None = field(default=None, repr=False)
    _dt_of_factors: float = 0.0
    _kinks: StageKinks = field(default_factory=StageKinks, repr=False)
    """Kinks on which the last step ended."""
    _border: Border | None = field(default=None, repr=False)
    """Border of these factors, of a box that yields."""
    _here: Evaluation | None = field(default=None, repr=False)
    """Evaluation at the end of the last step, before the last correction of its last stage."""
    _is_fresh: bool = True

    def forget(self) -> None:
        """Drop cached data, so that the continuation depends only on the public fields."""
        self._factors, self._here, self._is_fresh = None, None, True
        self._border, self._kinks = None, StageKinks()


class Step(NamedTuple):
    """An accepted step; counts are since the start of the flow."""

    step: int
    time: float
    strain: float
    phi: float
    pressure: float
    u: float
    dt: float
    error: float
    """Local error over the typical overlap."""
    evaluations: int
    factorisations: int
    rejected: int
    explicit: int
    wall_seconds: float


def compress(landscape: Landscape, flow: Flow, protocol: Protocol) -> Iterator[Step]:
    """Compress to the end of the protocol.

    Parameters
    ----------
    landscape : Landscape
    flow : Flow
        Initial or resumed state; updated.
    protocol : Protocol

    Yields
    ------
    Step
        After each accepted step.

    Raises
    ------
    CrossingError
        If spines cross at the start, or at a rate that exceeds the strength of contacts.
    """
    for step in follow(landscape, flow, protocol):
        yield step
        if step.pressure >= protocol.p_end:
            return


def follow(landscape: Landscape, flow: Flow, how: Course) -> Iterator[Step]:
    """Flow to the end of a course; errors as `compress`.

    Yields
    ------
    Step
        After each accepted step.
    """
    run = ImplicitFlow(landscape, flow, how)
    while not how.is_over(flow, run.phi):
        yield run.advance()


class Course(Proto):
    """Driving of a flow: host, end, and accuracy."""

    @property
    def tolerance(self) -> float:
        """Local error of a step over the typical overlap."""

    @property
    def k_d(self) -> float:
        """Drag, [energy time / length^(D + 2)]."""

    @property
    def largest_strain(self) -> float:
        """Largest strain of the box in a step."""

    @property
    def largest_drop(self) -> float:
        """Fraction of the elastic energy that a step may lose."""

    @property
    def method(self) -> str:
        """One of `METHODS`."""

    @property
    def control(self) -> BoxControl | None:
        """Normal stress to which the box yields, if any."""

    def leg(self, flow: Flow, phi: float) -> Leg:
        """Return the host, and for how long it applies."""

    def is_over(self, flow: Flow, phi: float) -> bool:
        """Whether the end is reached."""

    def measured(self, landscape: Landscape, flow: Flow) -> dict[str, float]:
        """Return measurements beyond a `Step`, by name."""

    def where(self, phi: float) -> str:
        """Describe the position, for messages."""


def drag_coefficients(landscape: Landscape, k_d: float = 1.0) -> FloatArray:
    """(n,) drag coefficients: k_d Area, and k_d Area I / A^2 for rotations, scaled to lengths A theta.

    Marschall & Teitel 2018, Eqs. 11 and 12; in space about the body's axes, with the volume.
    """
    return k_d * landscape.coordinates(_drag(landscape))


def _drag(landscape: Landscape) -> FloatArray:
    """(N, D + rotations) drag coefficients over k_d."""
    measure, moment = landscape.bodies.measure, landscape.bodies.moment
    D = landscape.particles.dimension
    length = np.where(landscape.rotation_length > 0, landscape.rotation_length, 1.0)
    about = moment[:, 2:] if D == 2 else moment
    turning = measure[:, None] * about / length[:, None] ** 2
    return np.column_stack([*[measure] * D, turning])


class _Trial(NamedTuple):
    """A step to try."""

    dt: float
    clipped: bool
    """Whether it ends with the period of the host."""
    explicit: bool


class _Attempt(NamedTuple):
    """Result of a trial step."""

    x: FloatArray
    """(n,) displacements due to forces, without the coordinate of the box."""
    path: _Path
    error: float
    evaluation: Evaluation


class _Accuracy(NamedTuple):
    """Accuracy of stages."""

    units: Units
    tolerance: float
    """Largest correction, in these units."""
    overlap: float
    """Typical overlap, over the size."""
    extended: bool


class ImplicitFlow:
    """A flow on its landscape; parameters and errors as `follow`."""

    def __init__(self, landscape: Landscape, flow: Flow, protocol: Course) -> None:
        self.landscape, self.flow, self.protocol = landscape, flow, protocol
        self.local_model = LocalEnergyModel(landscape, flow.state, along_bodies=True)
        self.box = (
            YieldingBox(protocol.control, landscape, protocol.k_d) if protocol.control else None
        )
        self.still = np.zeros(landscape.size)
        self.drag = drag_coefficients(landscape, protocol.k_d)
        if self.box:
            self.local_model.strain_along(self.box.axes)
            self.still, self.drag = np.append(self.still, 0.0), np.append(self.drag, self.box.drag)
        self._least_drag = _least_drag(landscape, protocol.k_d)
        self.measure = float(landscape.particles.measures.sum())
        self.size = self.reach = 2 * float(landscape.inner_radius.mean())
        self.dimension = landscape.particles.dimension
        self.host = Host(np.zeros((self.dimension, self.dimension)))
        self.columns = [_as_slice(landscape.column[:, k]) for k in range(self.dimension)]
        self.orientation = flow.state.orientation.astype(np.float64)
        self._crossing: CrossingError | None = None
        self._kinks = flow._kinks

    @property
    def phi(self) -> float:
        """Packing fraction."""
        return self.measure / self.flow.state.volume

    def advance(self) -> Step:
        """Take a step and count it."""
        flow, landscape = self.flow, self.landscape
        began, evaluations = time.perf_counter(), landscape.evaluations
        found, error, dt = self._step()
        flow.wall_seconds += time.perf_counter() - began
        flow.evaluations += landscape.evaluations - evaluations
        flow.steps += 1
        if self.box:
            self.box.require_bearing(self.phi)
        volume = flow.state.volume
        pressure = -found.strain_gradient / (self.dimension * volume)
        return Step(
            flow.steps, flow.time, flow.strain, self.phi, pressure, found.energy / volume, dt, error,
            flow.evaluations, flow.factorisations, flow.rejected, flow.explicit, flow.wall_seconds,
        )  # fmt: skip

    def _step(self) -> tuple[Evaluation, float, float]:
        """Take a step; return the evaluation at its end, its error and size."""
        flow = self.flow
        if flow._is_fresh:
            flow.state = flow.state.with_least_tilt()
            self.local_model.move_to(flow.state)
            self.local_model.forget_pairs()
            self._kinks = flow._kinks
            flow._is_fresh = False
        self.local_model.hold()
        self.orientation = flow.state.orientation.astype(np.float64)
        self.host, longest = self.protocol.leg(flow, self.phi)
        # Stage accuracy suffices for units and energies.
        here = flow._here or self._present()
        self.reach = self._reach_of(here)
        if not flow.velocity.size:
            self._begin(here)
        while True:
            trial = self._next_trial(longest)
            if trial.explicit and here is flow._here:
                here = self._present()
            attempt = self._tried(trial.dt, trial.explicit, here)
            if attempt is None:
                self._retreat(trial.dt)
            elif self._is_good(trial, attempt, here):
                break
        self._plan(trial, attempt.error)
        self._accept(attempt, trial.dt)
        return attempt.evaluation, attempt.error, trial.dt

    def _next_trial(self, longest: float) -> _Trial:
        """Choose the step to try, within the period of the host."""
        flow = self.flow
        dt = min(flow.dt, self._time_of_strain(1.0))
        clipped = dt >= 0.999 * longest
        dt = longest if clipped else dt
        explicit = flow.explicit_left > 0 or dt < self._stable
        if len(self._kinks) and dt > _LEAST_STEP * self._stable:
            explicit = False  # which would go from one side of a kink to the other
        if explicit:
            dt, clipped = min(dt, self._stable), False
        return _Trial(dt, clipped, explicit)

    def _retreat(self, dt: float) -> None:
        """Shorten the step after one without a solution."""
        self._refuse_crossing(dt)
        flow = self.flow
        flow.rejected += 1
        flow.held = _HELD
        flow.dt = _RETREAT * dt
        flow._factors = None
        if flow.dt < self._stable:
            flow.explicit_left = _EXPLICIT_IN_A_ROW

    def _is_good(self, trial: _Trial, attempt: _Attempt, here: Evaluation) -> bool:
        """Whether to accept an attempt; if not, shorten the step."""
        flow, relative = self.flow, attempt.error / self.protocol.tolerance
        is_least = trial.explicit and trial.dt <= _LEAST_STEP * self._stable
        if not is_least and self._falls_too_far(attempt.evaluation, here):
            flow.rejected += 1
            flow.held = _HELD
            flow.dt = _FALLING * trial.dt
            return False
        if relative <= 1 or is_least:
            return True
        flow.rejected += 1
        # Contacts that open or close within the step cause errors of first order.
        flow.dt = trial.dt * max(_SAFETY / relative, _LEAST_GROWTH)
        return False

    def _plan(self, trial: _Trial, error: float) -> None:
        """Choose the size of the next step."""
        flow, relative = self.flow, error / self.protocol.tolerance
        order = _HEUN_EULER.order_of_error if trial.explicit else self._method.order_of_error
        growth = _SAFETY * max(relative, 1e-10) ** (-1 / order)
        growth = min(max(growth, _LEAST_GROWTH), _LARGEST_GROWTH)
        if flow.held > 0:
            flow.held -= 1
            growth = min(growth, 1.0)
        if trial.explicit:
            flow.explicit += 1
            flow.explicit_left = max(flow.explicit_left - 1, 0)
            if flow.explicit_left == 0 and growth > 1:
                growth = max(growth, 4 * self._stable / trial.dt)
        if not (trial.clipped and growth > 1):
            flow.dt = trial.dt * growth
        else:
            flow.dt = max(flow.dt, trial.dt)

    def _evaluated(self) -> Evaluation:
        """Evaluate the present state."""
        at_rest = np.stack([np.eye(self.dimension), np.zeros((self.dimension, self.dimension))])
        n_turns = 1 if self.dimension == 2 else 3
        self.local_model.deform(at_rest, np.zeros((self.landscape.particles.n, n_turns)))
        return self.local_model.evaluate(np.zeros(self.landscape.size), 0.0, extended=False)

    def _refuse_crossing(self, dt: float) -> None:
        if self._crossing is None or dt > _AT_ONCE * min(self._stable, 1 / self._rate):
            return
        raise self._crossed(self._crossing)

    def _present(self) -> Evaluation:
        """Evaluate the present state; refuse spines that the last correction crossed."""
        try:
            return self._evaluated()
        except CrossingError as error:
            if self.flow.steps == 0:
                raise
            raise self._crossed(error) from None

    def _crossed(self, error: CrossingError) -> CrossingError:
        spines = str(error).partition(",")[0]
        pushes, less = (" and a pressure", ", use a smaller pressure") if self.box else ("", "")
        msg = (
            f"{spines} {self.protocol.where(self.phi)}, expected a rate{pushes} that their contacts withstand; flow"
            f" more slowly{less}, or end earlier"
        )
        return CrossingError(msg)

    def _falls_too_far(self, now: Evaluation, before: Evaluation) -> bool:
        # Contacts no stronger than the drag of the box motion open and close without an event.
        push = self._rate * self._least_drag * float(self.flow.state.edges.max())
        least = self.landscape.particles.n * (push * self.reach) ** 2 / self.landscape.stiffness
        return before.energy - now.energy > self.protocol.largest_drop * max(before.energy, least)

    @property
    def _method(self) -> Method:
        return METHODS[self.protocol.method]

    @property
    def _stable(self) -> float:
        """Estimate the longest explicit step, [time], drag over stiffness of a contact or two."""
        longest = self._least_drag * self.reach**2 / self.landscape.stiffness
        return _EXPLICIT_BELOW * (min(longest, self.box.longest_explicit) if self.box else longest)

    @property
    def _rate(self) -> float:
        """Largest of the rates of the host, [1/time]; also that at which the box yields."""
        return max(self.host.rate, self._yield_rate) if self.box else self.host.rate

    @property
    def _yield_rate(self) -> float:
        """Rate at which a box yields, [1/time], not zero."""
        assert self.box is not None
        return max(abs(float(self.flow.velocity[-1])) / self.box.length, 1e-300)

    def _time_of_strain(self, part: float) -> float:
        """Return the time of a part of the largest strain of a step."""
        rate, most = self.host.rate, part * self.protocol.largest_strain
        if self.box is None:
            return most / rate
        return min(most / rate if rate else math.inf, part * _YIELDED / self._yield_rate)

    def _slope(self, evaluation: Evaluation, growth: float = 1.0) -> FloatArray:
        """Return the derivatives of energy or enthalpy, with the growth of the volume since the start of the step."""
        if self.box is None:
            return evaluation.gradient
        of_box = self.box.slope(evaluation, growth * self.flow.state.volume)
        return np.append(evaluation.gradient, of_box)

    def _with_box(self, of_particles: FloatArray, of_box: FloatArray | float = 0.0) -> FloatArray:
        """Append the component of a box that yields to (n,) components."""
        return of_particles if self.box is None else np.append(of_particles, of_box)

    def _begin(self, here: Evaluation) -> None:
        flow = self.flow
        flow.velocity = -self._slope(here) / self.drag
        flow.acceleration = np.zeros_like(flow.velocity)
        if flow.dt == 0.0:
            speed = self._rms(flow.velocity)
            flow.dt = min(
                0.1 * self.protocol.tolerance**0.5 * self._unit(here) / max(speed, 1e-300),
                self._time_of_strain(0.01),
            )

    def _unit(self, evaluation: Evaluation) -> float:
        """Typical overlap, at least that caused by drag on a particle a diameter from the centre."""
        least = self._rate * self._least_drag * self.size
        harmonic = max(evaluation.bond_force, least) * self.reach**2 / self.landscape.stiffness
        return harmonic * self.landscape.law.overlap_over_harmonic(harmonic / self.reach)

    def _reach_of(self, evaluation: Evaluation) -> float:
        """Length over which contacts have their energy, less than the size where corners touch.

        Overlaps x of bonds with energies k (x / d)^m / m have the mean x = m U / F, weighted by their forces, the sum
        of which is F. From it, and the mean force k x^(m - 1) / d^m, follows d, larger the more the forces differ.
        """
        force, power = evaluation.bond_force, self.landscape.law.power
        if not evaluation.energy > 0:
            return self.size
        overlap = power * evaluation.energy / (evaluation.n_bonds * force)
        reach: float = (self.landscape.stiffness * overlap ** (power - 1) / force) ** (1 / power)
        return min(self.size, reach)

    def _rms(self, vector: FloatArray) -> float:
        """Root mean square over particles of a vector of coordinates."""
        return float(np.linalg.norm(vector)) / math.sqrt(self.landscape.particles.n)

    def _units(self, evaluation: Evaluation) -> Units:
        overlap, power = self._unit(evaluation), self.landscape.law.power
        bonds = max(evaluation.n_bonds, self.landscape.particles.n)
        relative = overlap / self.reach
        energy = bonds * self.landscape.stiffness * relative**power
        force = self.landscape.stiffness * overlap / self.reach**2 * relative ** (power - 2)
        return Units(force, energy, math.sqrt(overlap * self.reach), self.landscape.particles.n)

    def _is_extended(self, unit: float) -> bool:
        rounding = float(np.finfo(np.float64).eps) * self.size
        return rounding > _ROUNDING * _STAGE_ACCURACY * self.protocol.tolerance * unit

    def _tried(self, dt: float, explicit: bool, here: Evaluation) -> _Attempt | None:
        self._crossing = None
        try:
            if explicit:
                return self._explicit(dt, here)
            return self._implicit(dt, here)
        except CrossingError as error:
            self._crossing = error
            return None

    def _implicit(self, dt: float, here: Evaluation) -> _Attempt | None:
        flow, method = self.flow, self._method
        unit, units = self._unit(here), self._units(here)
        accuracy = _STAGE_ACCURACY * self.protocol.tolerance
        if not 1 / _SAME_STEP < dt / max(flow._dt_of_factors, 1e-300) < _SAME_STEP:
            flow._factors = None
        self._kinks = flow._kinks
        path = _Path(self, [dt * part for part in method.times])
        how = _Accuracy(units, accuracy, unit / self.size, self._is_extended(unit))
        evaluation, last = here, self.still
        for k, row in enumerate(method.weights):
            if row[k] == 0.0:
                path.add(flow.velocity)
                continue
            solved = self._solved(path, [dt * weight for weight in row], last, how)
            if solved is None:
                return None
            evaluation, last, velocity = solved
            path.add(velocity)
        flow._dt_of_factors = dt
        drag = self.drag / (dt * row[-1])
        force = drag * path.combined([dt * weight for weight in method.error])
        size = self._units(evaluation).size(self._response(force, drag), force, drag)
        return _Attempt(last[: self.landscape.size], path, size, evaluation)

    def _solved(
        self, path: _Path, times: list[float], last: FloatArray, how: _Accuracy
    ) -> tuple[Evaluation, FloatArray, FloatArray] | None:
        """Solve a stage; return the evaluation, the coordinates there and their velocity.

        The coordinate of a box that yields is found by a secant method. The solution at each of its values costs an
        evaluation or two, with the same factors.
        """
        own, n = times[len(path.velocities)], self.landscape.size
        drag = self.drag / own
        if self.box:  # whose guess does not depend on the transport of others
            guessed = (path.combined(times) + own * self._predicted(path))[-1]
            # Its last rate says nothing about times beyond its relaxation: there the box begins as it was.
            if not self.box.is_beyond(guessed - path.strained, how.overlap):
                path.strain_to(guessed)
        centre, velocity = path.combined(times), self._predicted(path)
        guess, secant = centre + own * velocity, Secant()
        guess[n:] = path.strained
        for _ in range(_BOXES if self.box else 1):
            path.go_to_stage()
            pushed = centre[:n] + own * path.turning.excess(guess[:n], velocity[:n])
            found = self._in_box(
                Stage(drag[:n], pushed, (guess[:n], last[:n]), how.extended), how, path
            )
            if not found.solved:
                return None
            x = self._with_box(found.x, path.strained)
            velocity = (x - centre) / own
            if self.box is None:
                return found.evaluation, x, velocity
            slope = self.box.slope(found.evaluation, path.growth * self.flow.state.volume)
            force = np.append(np.zeros(n), -drag[-1] * (x - centre)[-1] - slope)
            assert self.flow._border is not None
            stiffness = secant.stiffness((x[-1], force[-1]), drag[-1], self.flow._border)
            correction = self.flow._border.solve(np.zeros(n), force, stiffness)
            guess = x + correction
            if self.box.is_beyond(guess[-1], _OVERSTRAINED):
                return None
            path.strain_to(guess[-1])
            centre = path.combined(times)
            velocity = (guess - centre) / own
            if how.units.size(correction, force, drag) <= how.tolerance:
                return found.evaluation, guess, velocity
        return None

    def _response(self, force: FloatArray, drag: FloatArray) -> FloatArray:
        """Return the displacement of particles and box by a force, from the factors of the last stage."""
        factors, border = self.flow._factors, self.flow._border
        assert factors is not None
        inner = factors.factors.solve(force[: self.landscape.size])
        if self.box is None:
            return inner
        assert border is not None
        return border.solve(inner, force, drag[-1] + max(border.stiffness, 0.0))

    def _in_box(self, stage: Stage, how: _Accuracy, path: _Path) -> Solution:
        """Solve a stage in the box of a path; keep its factors."""
        flow = self.flow
        found = self.local_model.solve(
            stage, flow._factors or self._kinks, how.units, how.tolerance
        )
        flow.factorisations += found.factorisations
        flow._factors, self._kinks = found.factors, found.kinks
        if self.box and found.factorisations and found.factors:
            volume = path.growth * flow.state.volume
            flow._border = self.box.border(
                found.factors.factors,
                self.local_model.strain_derivatives,
                (found.evaluation, volume),
            )
        return found

    def _predicted(self, path: _Path) -> FloatArray:
        """Extrapolate the velocity to the next stage, or keep it."""
        flow, known = self.flow, len(path.velocities)
        last = path.velocity(known - 1) if known else path.carried(flow.velocity)
        if not flow.extrapolates:
            return last
        if known and path.times[known - 1] > 0:
            before = path.times[known - 1]
            slope = (last - path.carried(flow.velocity)) / before
            return last + (path.next_time - before) * slope
        return path.carried(flow.velocity + path.next_time * flow.acceleration)

    def _explicit(self, dt: float, here: Evaluation) -> _Attempt:
        extended = self._is_extended(self._unit(here))
        path = _Path(self, [dt * part for part in _HEUN_EULER.times])
        path.add(-self._slope(here) / self.drag)
        evaluation, n = here, self.landscape.size
        for row in _HEUN_EULER.weights[1:]:
            times = [dt * weight for weight in row]
            x = path.combined(times)
            if self.box:  # whose coordinate does not depend on the transport of others
                path.strain_to(x[-1])
                x = path.combined(times)
            path.go_to_stage()
            evaluation = self.local_model.evaluate(x[:n], 0.0, extended=extended)
            velocity = -self._slope(evaluation, path.growth) / self.drag
            path.add(velocity + self._with_box(path.turning.excess(x[:n], velocity[:n])))
        error = 0.5 * dt * (path.velocity(1) - path.velocity(0))
        return _Attempt(x[:n], path, self._rms(error) / self._unit(evaluation), evaluation)

    def _accept(self, attempt: _Attempt, dt: float) -> None:
        flow, path = self.flow, attempt.path
        begun, acceleration = (path.carried(v) for v in (flow.velocity, flow.acceleration))
        if self.box:  # as the last correction left it
            path.go_to_stage()
        self.local_model.move(attempt.x, 0.0)
        flow.state, flow._here = self.local_model.base, attempt.evaluation
        flow._kinks = self._kinks
        # Velocities jump when contacts open or close: extrapolation is then less accurate.
        jump = path.velocities[-1] - begun
        missed = np.linalg.norm(jump - dt * acceleration)
        flow.extrapolates = int(missed < _TOLD * np.linalg.norm(jump))
        flow.acceleration = jump / dt
        last, n = path.velocities[-1], self.landscape.size
        flow.velocity = self._with_box(path.turning.settled(attempt.x, last[:n]), last[n:])
        flow.time += dt
        flow.turned += path.turning.mean(attempt.x)
        flow.strain += self.host.rate * dt
        cell = flow.state.cell
        if abs(cell[0, 1]) > _LARGEST_TILT * cell[0, 0]:  # pair shifts refer to other cell vectors
            flow._is_fresh = True


def _least_drag(landscape: Landscape, k_d: float) -> float:
    """Return the least drag coefficient, in space without axes about which a body hardly extends."""
    drag, D = _drag(landscape), landscape.particles.dimension
    turning = drag[landscape.rotation_length > 0, D:].max(axis=1)
    return k_d * float(min(drag[:, 0].min(), turning.min(initial=np.inf)))


def _as_slice(numbers: IntArray) -> slice | IntArray:
    """Return equally spaced indices, as when all or no particles rotate, as a slice, which is faster."""
    apart = np.diff(numbers)
    if len(apart) and (apart == apart[0]).all() and apart[0] > 0:
        return slice(int(numbers[0]), int(numbers[-1]) + 1, int(apart[0]))
    return numbers


class _Path:
    """Trial step: host deformation and velocities at each stage.

    Velocities and displacements due to forces refer to the box at their stage; the host transports them to others.
    """

    def __init__(self, run: ImplicitFlow, times: list[float]) -> None:
        self.run, self.times = run, times
        self.velocities: list[FloatArray] = []
        self.turning = turning_of(run.landscape, run.orientation)
        self._strains = [0.0] * len(times)
        self._deformations: dict[tuple[float, float], LongArray] = {}

    @property
    def next_time(self) -> float:
        """Time of the next stage since the start of the step; of the last stage at the end."""
        return self.times[self._next]

    @property
    def strained(self) -> float:
        """Coordinate of a box that yields at that stage."""
        return self._strains[self._next]

    @property
    def growth(self) -> float:
        """Volume at that stage over that at the start of the step."""
        driven = math.exp(float(np.trace(self.run.host.gradient)) * self.next_time)
        return driven * self.run.box.growth(self.strained) if self.run.box else driven

    @property
    def _next(self) -> int:
        return min(len(self.velocities), len(self.times) - 1)

    def strain_to(self, coordinate: float) -> None:
        """Strain the box at the next stage, and at those after it."""
        self._strains[self._next :] = [float(coordinate)] * (len(self.times) - self._next)

    def add(self, velocity: FloatArray) -> None:
        """Store the velocity of a stage."""
        self.velocities.append(velocity)

    def velocity(self, stage: int) -> FloatArray:
        """Return a velocity, transported to the next stage."""
        return self.carried(self.velocities[stage], self.times[stage], self._strains[stage])

    def carried(self, vector: FloatArray, begun: float = 0.0, strained: float = 0.0) -> FloatArray:
        """Transport displacements or velocities from a time in the step, and a box, to the next stage."""
        after, further = self.next_time - begun, self.strained - strained
        if after == further == 0.0:
            return vector
        matrix, columns = self._deformation(after, further).astype(np.float64), self.run.columns
        found = vector.copy()
        for k, column in enumerate(columns):
            found[column] = matrix[k, k] * vector[column]
            for m in range(k + 1, len(columns)):
                if matrix[k, m]:
                    found[column] += matrix[k, m] * vector[columns[m]]
        return found

    def _deformation(self, after: float, strained: float) -> LongArray:
        key = after, strained
        if key not in self._deformations:
            matrix = self.run.host.gradient.astype(np.longdouble) * after
            if self.run.box:
                matrix = matrix + self.run.box.strain(strained)
            self._deformations[key] = exponential(matrix)
        return self._deformations[key]

    def combined(self, times: list[float]) -> FloatArray:
        """Displacement at the next stage by the velocities so far, each for a time."""
        used = zip(range(len(self.velocities)), times, strict=False)
        parts = (time * self.velocity(k) for k, time in used if time)
        return sum(parts, start=self.run.still)

    def go_to_stage(self) -> None:
        """Move box, positions and angles with the host to the next stage."""
        after = self.next_time
        matrix = self._deformation(after, self.strained)
        double = matrix.astype(np.float64)
        rest = (matrix - double).astype(np.float64)
        turns = self.turning.by_host(self._mean_host(after), after)
        self.run.local_model.deform(np.stack([double, rest]), turns)

    def _mean_host(self, after: float) -> Host:
        """Return the mean velocity gradient since the start of the step, which rotates particles to second order."""
        if self.run.box is None:
            return self.run.host
        yielded = self.run.box.strain(self.strained).astype(np.float64)
        return Host(self.run.host.gradient + yielded / after)
