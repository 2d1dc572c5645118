"""Minima of the enthalpy: packings at a pressure, an energy or a packing fraction in boxes that yield.

Unknowns are the particles and the components of an upper triangular strain of the box that are free. At a minimum of
H = U + p V over these the pressure tensor is P = p 1 in these components. The box takes Newton steps of the enthalpy
of the relaxed packing, whose second derivative is K - X^T M^-1 X (Dagois-Bohy et al., Phys. Rev. Lett. 109, 095703
(2012), for the bordered Hessian); particles follow by linear response and are then minimised. At a fixed volume the same
holds for the strains that keep it. Independent of shape and dimension.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray, LongArray
from jamshape.checks import ArgumentError, require_in, require_positive, require_stated
from jamshape.contacts import CrossingError
from jamshape.landscape import Landscape
from jamshape.landscape.local_energy_model import LocalEnergyModel
from jamshape.landscape.newton import least_shift
from jamshape.minima.descent import History, Minimum, Outcome, Stop, rounding_floor
from jamshape.minima.minimise import minimise
from jamshape.minima.target import (
    Target,
    TargetError,
    fraction_of_energy,
    require_reachable,
    strain_at,
)
from jamshape.packing import State
from jamshape.packing.box import COMPONENTS

FIXED, ISOTROPIC, FREE, SHEAR = "fixed", "isotropic", "free", "xy"

_MOST_STEPS = 400  # of the box
_ROUGH, _FINER = 1e-6, 0.5  # residual of minima on the way, and its change where that is too much
_TIGHT, _FLOORS = (
    1e-12,
    10.0,
)  # residual near the end, where soft modes move stresses; at least ten times the rounding
_NEAR = (
    0.1  # relative distance of the stress to its target below which minima have the full tolerance
)
_ACCURACY = 1e-9  # of the linear response
_SHIFT = 1e-13  # least shift of the Hessian, over the stiffness of a bond, so that translations do not take up rounding
_FALLEN = 1e-2  # fraction of the expected energy below which the packing has come apart
_LONGEST = 5e-3  # largest strain in a step
_CLOSING = 1e-5  # first strain of an unjammed packing; doubled each time
_REACH, _LEAST_REACH = 0.5, 1e-7  # strain in a step over that from jamming
_SMALL_REACH = 0.02  # below which a packing that comes apart is unstable
_SLIDING = 1e-5  # residual that sliding leaves; see `target`
_FIRST_LEVEL = 1e-3  # of the pressure, in k_e / length^D
_LOWER, _MOST_LIFTS, _MOST_LIFTED = (
    0.1,
    8,
    100.0,
)  # factor to the next pressure; most times, and factor, that it is raised
_SETTLED = 1e-2  # stress error at which it is reduced
_ROUNDING = 1e-12  # relative, of the enthalpy
_VOLUME = 1e-15  # relative error of the volume


def strains_of(box: str, dimension: int) -> FloatArray:
    """Return a basis of the strains in which a box yields.

    Parameters
    ----------
    box : str
        ``isotropic``, ``free``, or components such as ``xx yy xy``.
    dimension : int

    Returns
    -------
    (k, D, D) array of float64
        Upper triangular. Only the first one changes the volume; if none does, it is 0.

    Raises
    ------
    ArgumentError
        If the box is none of these.

    Examples
    --------
    >>> strains_of("xx xy", 2)[:, 0]
    array([[1., 0.],
           [0., 1.]])
    """
    names = COMPONENTS[dimension]
    words = names if box == FREE else tuple(box.split())
    if box == ISOTROPIC:
        return np.eye(dimension)[None]
    if not words or len(set(words)) < len(words) or not set(words) <= set(names):
        said = "{box:name} is " + repr(box) + ", expected isotropic, free or components such as "
        said += f"{names[0]!r} or {' '.join(names)!r}"
        raise ArgumentError(said, {"box": box})
    axes = [k for k in range(dimension) if "xyz"[k] * 2 in words]
    found = [np.zeros((dimension, dimension))]
    found[0][axes, axes] = 1.0
    for n in range(1, len(axes)):  # differences
        found.append(np.zeros((dimension, dimension)))
        found[-1][axes[: n + 1], axes[: n + 1]] = [*[1.0] * n, -n]
        found[-1] /= math.sqrt(n * (n + 1))
    for a, b in (("xyz".index(w[0]), "xyz".index(w[1])) for w in words if w[0] != w[1]):
        found.append(np.zeros((dimension, dimension)))
        found[-1][a, b] = 1.0
    return np.array(found)


class FlowError(TargetError):
    """A packing does not resist a shear stress: its box shears without an end."""


@dataclass(frozen=True)
class Yielding:
    """Goal of a minimisation in a box that yields: one of pressure, u0 and phi, or none if the box keeps its volume.

    Parameters
    ----------
    box
        ``isotropic``, ``free``, or components such as ``xx yy xy``.
    pressure, u0
        [energy / length^D]
    phi
        Packing fraction.
    accuracy
        Largest difference of the pressure tensor to its target over the pressure, and of u over u0.
    tolerance
        Largest residual of the particles.
    shear
        Shear stress to resist, that is -p_xy, [energy / length^D]; has no effect if the component xy is held.
    most_strain
        Largest shear of the box on the way, beyond which the packing counts as flowing.

    Raises
    ------
    ValueError
        If not one target is given, or a number is out of its range.
    """

    box: str = ISOTROPIC
    pressure: float | None = None
    u0: float | None = None
    phi: float | None = None
    accuracy: float = 1e-8
    tolerance: float = 1e-8
    shear: float = 0.0
    most_strain: float = math.inf

    def __post_init__(self) -> None:
        given = {name: getattr(self, name) for name in ("pressure", "u0", "phi")}
        given = {name: value for name, value in given.items() if value is not None}
        if len(given) != 1 and (given or self.box != SHEAR):
            found = " and ".join(given) or "none"
            msg = f"targets are {found}, expected one of pressure, u0 and phi"
            raise ValueError(msg)
        # Targets have ranges that depend on the law.
        require_positive(**given)
        require_stated(accuracy=self.accuracy, tolerance=self.tolerance)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings as attributes of a file, where names without `target` are of measurements."""
        names = {"pressure": "target_pressure", "u0": "u0", "phi": "target_phi"}
        told = {
            new: value for old, new in names.items() if (value := getattr(self, old)) is not None
        }
        return told | {
            "box_yields": self.box,
            "accuracy": self.accuracy,
            "tolerance": self.tolerance,
        }

    @property
    def aim(self) -> str:
        """The target in words."""
        if self.pressure is not None:
            return f"pressure = {self.pressure:g}"
        return f"u0 = {self.u0:g}" if self.u0 is not None else f"phi = {self.phi:g}"

    def require(self, landscape: Landscape) -> None:
        """Refuse a box that the target cannot have, or a target out of reach; raises ValueError."""
        for name in ("u0", "pressure"):
            if (value := getattr(self, name)) is not None:
                require_in(name, value, landscape.law.range_of(name))
        if self.u0 is not None:
            require_reachable(landscape, Target(self.u0))
        strains = strains_of(self.box, landscape.particles.dimension)
        named = [name for name in ("pressure", "u0", "phi") if getattr(self, name) is not None]
        if not strains[0].any() and named:
            name = named[0]
            said = (
                "{box} keeps the volume, which {"
                + name
                + "} needs to change, expected a component such as xx as well"
            )
            raise ArgumentError(said, {"box": self.box, name: getattr(self, name)})

    @property
    def keeps_volume(self) -> bool:
        """Whether the volume is no unknown."""
        return self.pressure is None and self.u0 is None

    def stress(self, pressure: float, dimension: int) -> FloatArray:
        """Return the pressure tensor (D, D) to reach at a pressure."""
        found = pressure * np.eye(dimension)
        found[0, 1] = found[1, 0] = -self.shear
        return found

    def find(self, landscape: Landscape, start: State) -> Minimum:
        """Find the packing at the goal, from a state; errors as `advance` and `require`."""
        self.require(landscape)
        at = Settling(start)
        while not at.done:
            advance(landscape, at, self)
        assert at.present is not None
        return at.present


@dataclass(eq=False)
class Settling:
    """A packing whose box yields, between two minimisations, with all that is needed to resume it.

    Parameters
    ----------
    state
        State to minimise first.
    present
        Its last minimum.
    reach
        Largest strain of the next step, over the strain from jamming.
    closing
        Strain of the next compression of an unjammed state.
    first
        Pressure to reach first, where the target is smaller, [energy / length^D]; that of the start by default.
    level
        The present one of such pressures, which fall as the stress gets there.
    n_lifts
        Times that it was raised.
    n_steps
        Steps of the box so far.
    stress_error
        Largest difference of the stress to its target, over the pressure.
    deformation : (D, D) array of float64
        Of the box since the start.
    tolerance
        Residual of the particles that suffices; grows where only sliding is left.
    rough
        Residual of minima on the way; falls where forces that are left make predictions wrong.
    done
        Whether the goal is reached, or as near as can be.
    """

    state: State
    present: Minimum | None = None
    reach: float = _REACH
    closing: float = _CLOSING
    first: float | None = None
    level: float = 0.0
    n_lifts: int = 0
    n_steps: int = 0
    stress_error: float = math.inf
    tolerance: float = 0.0
    rough: float = _ROUGH
    done: bool = False
    deformation: FloatArray | None = None
    history: History = field(default_factory=History)

    @property
    def sheared(self) -> float:
        """Shear strain of the box since the start."""
        F = self.deformation
        return 0.0 if F is None else float(F[0, 1] / F[1, 1])

    def deform(self, matrix: LongArray) -> None:
        """Take note of a further deformation."""
        before = np.eye(len(matrix)) if self.deformation is None else self.deformation
        self.deformation = np.asarray(matrix, np.float64) @ before


class _Posed(NamedTuple):
    """Newton's equations of the box at a minimum of the particles."""

    strains: FloatArray
    """(k, D, D) strains to choose from."""
    slope: FloatArray
    """(k,) derivative of the enthalpy, with particles following."""
    curvature: FloatArray
    """(k, k) its second derivative; not symmetric where the target stress is not isotropic."""
    response: FloatArray
    """(k + 1, n) motion of the particles by each strain, and by their remaining forces."""


def _pressures(
    landscape: Landscape, tensor: FloatArray, at: Settling, goal: Yielding
) -> tuple[float, float]:
    """Return the mean pressure in the components that may change the volume, and the one to reach."""
    present, normal = at.present, strains_of(goal.box, len(tensor))[0]
    assert present is not None
    normal = normal if normal.any() else np.eye(len(tensor))
    pressure = float((tensor * normal).sum() / normal.sum())
    if goal.keeps_volume:
        return pressure, pressure
    if goal.pressure is not None:
        return pressure, max(goal.pressure, at.level)
    assert goal.u0 is not None
    root = landscape.law.root(goal.u0 / present.energy_density)
    return pressure, max(pressure * root ** (landscape.law.power - 1), at.level)


def advance(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Minimise the particles once, at the first box or after a step of it.

    Parameters
    ----------
    landscape : Landscape
    at : Settling
        Updated.
    goal : Yielding

    Raises
    ------
    FlowError
        If the box shears by more than the largest strain.
    TargetError
        If the goal is not reached.
    CrossingError
        If spines cross at the start.
    """
    if at.present is None:
        at.tolerance = goal.tolerance
        at.present = minimise(landscape, at.state, "auto", Stop(goal.tolerance), at.history)
        if _changes_shape(goal, at.state):
            is_loose = at.present.outcome is Outcome.UNJAMMED
            tensor = landscape.stress(at.present.state)
            present = math.inf if is_loose else _pressures(landscape, tensor, at, goal)[0]
            at.level = min(first_level(landscape), present) if at.first is None else at.first
    elif at.n_steps >= _MOST_STEPS:
        _give_up(at, goal)
    elif at.reach < _LEAST_REACH:
        _lift(landscape, at, goal)
    elif not _has_volume(landscape, at.present.state, goal):
        _change_volume(landscape, at, goal)
    elif at.present.outcome is Outcome.UNJAMMED:
        _close(landscape, at, goal)
    else:
        _step(landscape, at, goal)
    at.n_steps += 1
    at.state = at.present.state
    if abs(at.sheared) > goal.most_strain:
        msg = f"the box sheared by {at.sheared:.3g} at a stress of {goal.shear:g}, expected at most {goal.most_strain:g}"
        raise FlowError(msg)
    _judge(landscape, at, goal)


def _judge(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Decide whether the goal is reached."""
    present = at.present
    assert present is not None
    if not _has_volume(landscape, present.state, goal):
        return
    if present.outcome is Outcome.UNJAMMED:
        if goal.keeps_volume and goal.shear:
            msg = f"the packing unjammed at a strain of {at.sheared:.3g}, expected one that resists a stress of {goal.shear:g}"
            raise FlowError(msg)
        at.done, at.stress_error = goal.keeps_volume, 0.0
        return
    tensor = landscape.stress(present.state)
    aim = _pressures(landscape, tensor, at, goal)[1]
    at.stress_error = _stress_error(tensor, aim, goal)
    if not goal.keeps_volume and at.level == aim:
        if at.stress_error < _SETTLED:
            at.level *= _LOWER
        return
    left = present.residual.largest
    if present.outcome is Outcome.STALLED and left < _SLIDING:
        at.tolerance = max(at.tolerance, 1.5 * left)
        if left <= goal.tolerance:  # short of a tighter one only
            at.present = present = replace(present, outcome=Outcome.CONVERGED)
    is_balanced = left <= at.tolerance or present.outcome is Outcome.KINK
    at.done = is_balanced and at.stress_error <= goal.accuracy and _has_energy(present, goal)


def _stress_error(tensor: FloatArray, aim: float, goal: Yielding) -> float:
    """Return the largest difference of the stress to its target in the components that yield, over the pressure."""
    strains = strains_of(goal.box, len(tensor))[int(goal.keeps_volume) :]
    off = tensor - goal.stress(aim, len(tensor))
    return float(np.abs(np.einsum("ab,kab->k", off, strains)).max(initial=0.0)) / aim


def _has_energy(present: Minimum, goal: Yielding) -> bool:
    return goal.u0 is None or abs(present.energy_density / goal.u0 - 1) <= goal.accuracy


def _volume_of(landscape: Landscape, goal: Yielding) -> float:
    assert goal.phi is not None
    return float(landscape.particles.measures.sum()) / goal.phi


def _has_volume(landscape: Landscape, state: State, goal: Yielding) -> bool:
    return goal.phi is None or abs(state.volume / _volume_of(landscape, goal) - 1) <= _VOLUME


def first_level(landscape: Landscape) -> float:
    """Return a pressure at which unstable boxes yield in few steps, [energy / length^D]."""
    level: float = _FIRST_LEVEL ** (landscape.law.power - 1) * landscape.stiffness
    return level / landscape.length**landscape.particles.dimension


def _changes_shape(goal: Yielding, state: State) -> bool:
    return len(strains_of(goal.box, state.dimension)) > 1


def _lift(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Continue at a higher pressure where contacts open and close within the smallest steps."""
    assert at.present is not None
    aim = _pressures(landscape, landscape.stress(at.present.state), at, goal)[1]
    level = max(at.level, aim) / _LOWER
    if (
        at.n_lifts == _MOST_LIFTS
        or goal.keeps_volume
        or level > _MOST_LIFTED * first_level(landscape)
    ):
        _give_up(at, goal)
    at.level, at.reach, at.n_lifts = level, _REACH, at.n_lifts + 1


def _give_up(at: Settling, goal: Yielding) -> None:
    assert at.present is not None
    pressure = -at.present.evaluation.strain_gradient / (at.state.dimension * at.state.volume)
    msg = (
        f"after {at.n_steps} steps of the box the pressure is {pressure:.6g} and u {at.present.energy_density:.6g}, with"
        f" stresses off by {at.stress_error:.2g} of the pressure and a residual of {at.present.residual.largest:.2g}, expected"
        f" {goal.aim} within {goal.accuracy:g}; take another target or another start"
    )
    raise TargetError(msg)


def _change_volume(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Strain the box towards its packing fraction by a bounded step."""
    present = at.present
    assert present is not None
    normal = strains_of(goal.box, present.state.dimension)[0]
    whole = (_volume_of(landscape, goal) / present.state.volume) ** (1 / normal.sum()) - 1
    strain = float(np.clip(whole, -_LONGEST, _LONGEST))
    is_last = strain == whole
    state = present.state.deformed(
        np.eye(len(normal), dtype=np.longdouble) + np.longdouble(strain) * normal
    )
    tolerance = goal.tolerance if is_last else max(goal.tolerance, _ROUGH)
    at.present = minimise(landscape, state, "auto", Stop(tolerance), at.history)


def _close(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Compress an unjammed packing."""
    assert at.present is not None
    normal = strains_of(goal.box, at.state.dimension)[0]
    state = at.state.deformed(
        np.eye(len(normal), dtype=np.longdouble) - np.longdouble(at.closing) * normal
    )
    at.closing, at.reach = min(2 * at.closing, _LONGEST), _REACH
    at.present = minimise(landscape, state, "auto", Stop(_ROUGH), at.history)


class _Trial(NamedTuple):
    """A step of the box to try."""

    state: State
    """Strained, with particles moved along."""
    matrix: LongArray
    """(D, D) deformation of the box."""
    aim: float
    """Pressure to reach."""
    expected: float
    """Change of the enthalpy."""
    part: float
    """Strain over that from jamming."""
    is_near: bool
    """Whether it leads to the target, not to the limit of a step."""
    stop: Stop


def _step(landscape: Landscape, at: Settling, goal: Yielding) -> None:
    """Take a step of the box, and accept it if the enthalpy falls."""
    present = at.present
    assert present is not None
    trial = _trial(landscape, at, goal)
    try:
        found = minimise(landscape, trial.state, "near", trial.stop, at.history)
    except CrossingError:
        at.reach /= 4
        return
    if found.outcome is Outcome.UNJAMMED and at.reach >= _SMALL_REACH:  # opened too far
        at.reach /= 4
        return
    if found.outcome is Outcome.UNJAMMED:  # unstable to the strain
        at.closing = _CLOSING
        at.level = first_level(landscape) if _changes_shape(goal, found.state) else 0.0
    elif not _is_better(landscape, (at, trial, found), goal):
        if present.residual.largest > at.tolerance:  # forces that are left make predictions wrong
            at.rough = max(_FINER * at.rough, goal.tolerance)
            stop = Stop(at.tolerance)
            at.present = minimise(landscape, present.state, "near", stop, at.history)
        else:
            at.reach = trial.part / 4
        return
    at.present = found
    at.deform(trial.matrix)


def _trial(landscape: Landscape, at: Settling, goal: Yielding) -> _Trial:
    """Choose the next step: that of Newton, or the best one within the reach."""
    present = at.present
    assert present is not None
    state = present.state
    tensor = landscape.stress(state)
    pressure, aim = _pressures(landscape, tensor, at, goal)
    every = strains_of(goal.box, state.dimension)
    stress = goal.stress(aim, state.dimension)
    posed = _posed(landscape, present, every[int(goal.keeps_volume) :], (tensor, stress))
    from_jamming = strain_at(landscape, present.energy_density)
    largest = min(at.reach * from_jamming, _LONGEST)
    e = _within(posed, largest)
    length = float(np.linalg.norm(e))
    x = -(e @ posed.response[:-1]) - posed.response[-1]
    x *= LocalEnergyModel(landscape, state).part_within(x)
    matrix = _matrix(posed.strains, e, every[0], keeps_volume=goal.keeps_volume)
    moved = landscape.displaced(state, x).deformed(matrix).with_least_tilt()
    is_near = length < 0.999 * largest and at.stress_error < _NEAR
    tolerance = max(goal.tolerance, at.rough)
    if is_near:
        floor = _FLOORS * rounding_floor(present.evaluation, landscape)
        is_sliding = at.tolerance > goal.tolerance
        tolerance = at.tolerance if is_sliding else min(goal.tolerance, max(_TIGHT, floor))
    power = landscape.law.power
    falls = min(1.0, (aim / pressure) ** (power / (power - 1))) if pressure > 0 else 1.0
    least = fraction_of_energy(landscape, _FALLEN) * falls
    stop = Stop(tolerance, lowest=least * present.energy_density)
    expected = float(posed.slope @ e + 0.5 * e @ posed.curvature @ e)
    return _Trial(moved, matrix, aim, expected, length / from_jamming, is_near, stop)


def _is_better(
    landscape: Landscape, step: tuple[Settling, _Trial, Minimum], goal: Yielding
) -> bool:
    """Whether a step lowers the enthalpy or, within rounding, the error of the stress; adapts the reach."""
    at, trial, found = step
    present = at.present
    assert present is not None
    volume, grown = present.state.volume, float(np.prod(np.diagonal(trial.matrix))) - 1
    gained = found.evaluation.energy - present.evaluation.energy
    gained += volume * (trial.aim * grown - goal.shear * float(trial.matrix[0, 1]))
    strain = np.abs(trial.matrix - np.eye(len(trial.matrix))).sum()
    noise = _ROUNDING * (present.evaluation.energy + abs(trial.aim) * volume * float(strain))
    error = (
        _stress_error(landscape.stress(found.state), trial.aim, goal) if trial.is_near else math.inf
    )
    settles = error < 0.5 * at.stress_error
    if gained > noise and not settles:
        return False
    if gained < 0.5 * trial.expected or trial.is_near:
        at.reach = min(2 * at.reach, _LONGEST / strain_at(landscape, present.energy_density))
    return True


def _posed(
    landscape: Landscape,
    present: Minimum,
    strains: FloatArray,
    stresses: tuple[FloatArray, FloatArray],
) -> _Posed:
    """Set up Newton's equations for strains, at the pressure tensors that are and are to be."""
    state, volume = present.state, present.state.volume
    least = _SHIFT * landscape.stiffness_at(present.evaluation.bond_force) / landscape.length**2
    shift = max(least, least_shift(landscape, present.evaluation))
    newton = LocalEnergyModel(landscape, state).newton(shift)
    newton.prepare()
    coupling, own = landscape.strained(state, strains)
    # Smaller forces are rounding, which soft modes would amplify.
    gradient = present.evaluation.gradient * (present.residual.largest > _ROUGH / 10)
    response = np.asarray(newton.solve(np.vstack([coupling, gradient]), _ACCURACY))
    tensor, aim = stresses
    off = tensor - aim
    slope = -volume * np.einsum("ab,kab->k", off, strains) - response[-1] @ coupling.T
    traces = np.trace(strains, axis1=1, axis2=2)
    # Derivatives of V S F^-T, S the target, by F at F = 1.
    along = np.einsum("ab,kab->k", aim, strains)
    turned = np.einsum("ac,lbc,kab->kl", aim, strains, strains)
    curvature = own + volume * (np.outer(along, traces) - turned)
    return _Posed(strains, slope, curvature - coupling @ response[:-1].T, response)


def _within(posed: _Posed, largest: float) -> FloatArray:
    """Minimise the quadratic model of the enthalpy within a ball."""
    values, axes = np.linalg.eigh(0.5 * (posed.curvature + posed.curvature.T))
    if values[0] > 0:
        whole = -np.linalg.solve(posed.curvature, posed.slope)
        if np.linalg.norm(whole) <= largest:
            return np.asarray(whole)
    along, gaps = axes.T @ posed.slope, values - min(0.0, float(values[0]))

    def at(shift: float) -> FloatArray:
        return np.asarray(-along / np.maximum(gaps + shift, 1e-300))

    low, high = 0.0, float(np.linalg.norm(along)) / largest
    for _ in range(200):
        middle = 0.5 * (low + high)
        if np.linalg.norm(at(middle)) > largest:
            low = middle
        else:
            high = middle
    return np.asarray(axes @ at(high))


def _matrix(strains: FloatArray, e: FloatArray, normal: FloatArray, *, keeps_volume: bool) -> Any:
    """Return the deformation (D, D) of a strain, in long double."""
    found = np.eye(len(normal), dtype=np.longdouble) + np.einsum(
        "k,kab->ab", e.astype(np.longdouble), strains
    )
    if keeps_volume:
        scale = np.prod(np.diagonal(found)) ** (-1 / np.longdouble(max(normal.sum(), 1)))
        found = found @ np.diag(np.where(np.diagonal(normal) > 0, scale, 1))
    return found
