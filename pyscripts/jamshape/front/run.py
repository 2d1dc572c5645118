"""Recorded runs: observables, frames, and what is derived from them."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arguments import checked
from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.checks import (
    NotReachedWarning,
    Range,
    require_in,
    require_number,
    require_positive,
)
from jamshape.files.content import add_attributes
from jamshape.files.disk import named, settled
from jamshape.files.h5md import (
    count_frames,
    read_attributes,
    read_observables,
    read_packing,
    read_report,
    read_style,
)
from jamshape.files.lock import Lock
from jamshape.flow.cyclic_shear import QUARTERS
from jamshape.flow.quasistatic import QuasistaticShear, sheared
from jamshape.front.frames import recorded_frames
from jamshape.front.packing import Packing
from jamshape.front.progress import follow, place
from jamshape.landscape import Landscape, State
from jamshape.measures.contact_changes import (
    RETURNED,
    At,
    ContactChange,
    Search,
    contact_changes,
    numbers_of_changes,
)
from jamshape.measures.cycles import Cycle, Ends, Rows, Yielding, cycles_of
from jamshape.measures.events import Event, stress_drops
from jamshape.measures.jamming import Jamming, Tried, minimised_frames
from jamshape.measures.onset import OnsetFit, fit_onset
from jamshape.measures.steady import SteadyState, steady_state
from jamshape.packing import Packing as PackingLike
from jamshape.protocols.ladder import Ladder, bring
from jamshape.recording.driver import Told
from jamshape.shapes.shape import Interaction

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_WITHIN = Range(1e-12, 1.0, "a relative distance")
_PART_OF_WITHIN = 0.1  # accuracy of states that enclose a change


@dataclass(frozen=True, eq=False)
class Recorded:
    """A run in its H5MD file, of any kind.

    Parameters
    ----------
    file : Path
    folder : object, optional
        Keeps the temporary folder of a run without a file of its own.
    """

    file: Path
    folder: Any = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "file", settled(self.file))

    def save(self, path: str | Path) -> None:
        """Write a copy, as in `jamshape.save`."""
        from jamshape.front.files import save  # noqa: PLC0415 - which knows runs

        save(path, self)

    def __reduce__(self) -> Any:
        if self.folder is None:
            return type(self), (self.file,)
        return _brought_along, (type(self), self.file.name, self.file.read_bytes())

    @cached_property
    def about(self) -> dict[str, Any]:
        """Attributes of the file (particles and settings)."""
        return read_attributes(self.file)

    @cached_property
    def observables(self) -> dict[str, FloatArray]:
        """(T, ...) arrays by name, a row for each sample, such as ``z``, ``u`` and ``S_2``."""
        return read_observables(self.file)

    def __getitem__(self, name: str) -> FloatArray:
        """Look up an observable by its name."""
        if name not in self.observables:
            msg = f"{name} is not an observable of {self.file}, expected one of {', '.join(self.observables)}"
            raise KeyError(msg)
        return self.observables[name]

    @property
    def phi(self) -> FloatArray:
        """(T,) packing fractions."""
        return self["phi"]

    def _changes(self, search: Search, values: FloatArray, first: int = 0) -> list[ContactChange]:
        """Compare all frames from the first one on, which have these values of the control parameter."""
        if search.within is not None:
            require_in("within", search.within, _WITHIN)
        return contact_changes(self._states(values, first), search)

    def _states(self, values: FloatArray, first: int = 0) -> Iterator[At]:
        """Read the frames from the first one on, which have these values."""
        return (At(value, self.packing(first + k)) for k, value in enumerate(values.tolist()))

    @property
    def pressure(self) -> FloatArray:
        """(T,) pressures, [energy / length^D]."""
        return self["pressure"]

    def warn_unless_reached(self) -> None:
        """Warn if a finished run did not reach its goal."""

    def __len__(self) -> int:
        """Count the frames."""
        return count_frames(self.file)

    @checked
    def packing(self, frame: int = -1) -> Packing:
        """Read a frame, counted from 0 or, if negative, from the end."""
        return Packing.read(self.file, frame)

    def __iter__(self) -> Iterator[Packing]:
        return iter(recorded_frames(self.file))

    def plot(self, axes: Axes | None = None) -> Axes:
        """Draw the pressure; arguments as in `jamshape.plot`."""
        from jamshape.front.pictures import plot  # noqa: PLC0415 - which knows runs

        return plot(self, axes)

    def _repr_html_(self) -> str:
        from jamshape.front.pictures import html  # noqa: PLC0415 - only notebooks ask

        return html(self)

    def _who(self) -> str:
        """Describe the particles."""
        shape, dimension = read_style(self.file)
        n = self.about.get("n") or self.packing().n
        return f"{n} {shape}s in {dimension}D"

    def _where(self) -> str:
        state = "" if self.about.get("finished") else ", not finished"
        return f"{state}, in {named(self.file)}"


class RunFile(Recorded):
    """A compression in its H5MD file; parameters as in `Recorded`.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=4)
    >>> run = js.compress(rods, n=24, phi=(0.4, 0.95), kappa=1e-3, file="run.h5", progress=False)
    >>> run.phi.shape, len(run), run.packing().n
    ((401,), 21, 24)
    >>> round(float(run.phi[-1]), 6), round(run.onset().phi_J, 2)
    (0.95, 0.7)
    """

    @property
    def kappa(self) -> float:
        """Compression rate at the end, [1/time]."""
        return float(np.ravel(self.about["kappa"])[-1])

    def warn_unless_reached(self) -> None:
        """Warn if the target pressure was not reached."""
        aim = float(self.about.get("p_end", math.inf))
        if self.about.get("finished") and math.isfinite(aim) and self.pressure[-1] < aim:
            said = (
                f"the pressure is {self.pressure[-1]:.3g} at the end, phi = {self.phi[-1]:.6g}, expected"
                " {p_end}; take a larger {phi_end:name}"
            )
            warnings.warn(NotReachedWarning(said, {"p_end": aim, "phi_end": None}), stacklevel=3)

    def onset(self) -> OnsetFit | None:
        """Fit phi_J(kappa), the onset of pressure at this rate; None if the pressure does not rise.

        A pressure of flow has an onset, too; `jamming` finds from which frame on states are jammed.

        Returns
        -------
        OnsetFit or None
            ``phi_J`` is phi_J(kappa), and ``phi_J_error`` is the spread over fit windows; see
            `jamshape.measures.onset.fit_onset`.
        """
        try:
            return fit_onset(self.phi, self.pressure, power=Interaction.told(self.about).power)
        except ValueError:  # it ends below jamming
            return None

    @checked
    def jamming(self, *, progress: bool = True) -> Jamming:
        """Minimise frames, from the densest down, to find which stay jammed without driving.

        Parameters
        ----------
        progress : bool
            Whether to show progress on standard error.

        Returns
        -------
        Jamming
            Packing fractions ``unjams`` and ``jams`` of the densest frame that unjams and of the next one,
            which stays jammed. They are stored in the file of a finished run, and its figures show them.

        Warns
        -----
        NotReachedWarning
            If minimisations of some frames did not finish and an end of the bracket is unknown for that.

        Examples
        --------
        >>> import jamshape as js
        >>> rods = js.Spherocylinders(alpha=4)
        >>> run = js.compress(rods, n=24, phi=(0.4, 0.95), kappa=1e-3, file="run.h5", progress=False)
        >>> found = run.jamming(progress=False)
        >>> run.onset().phi_J < found.unjams < found.jams
        True
        """
        found = Jamming.stored(self.about) or self._minimised(progress=progress)
        found.warn_if_not_found()
        return found

    def _minimised(self, *, progress: bool) -> Jamming:
        """Minimise frames, and store the result in the file of a finished run."""
        tried: list[Tried] = []

        def told(one: Tried) -> Told:
            tried.append(one)
            return Told("minimising frames", str(one))

        frames = minimised_frames(len(self), lambda frame: read_packing(self.file, frame))
        follow(frames, told, shown=progress)
        found = Jamming.of(tried)
        if self.about.get("finished"):
            with suppress(OSError), Lock(self.file):  # or it may only be read
                add_attributes(self.file, found.attributes())
            self.__dict__.pop("about", None)
        return found

    def __repr__(self) -> str:
        end = f"phi = {self.phi[-1]:.5g}, pressure = {self.pressure[-1]:.3g}"
        return f"<Run of {self._who()} at kappa = {self.kappa:g}: {len(self)} frames to {end}{self._where()}>"


class ShearFile(Recorded):
    """A shear in its H5MD file; parameters as in `Recorded`.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=4)
    >>> run = js.shear(rods, n=24, phi=0.6, gdot=1e-2, strain=3, file="shear.h5", progress=False)
    >>> run
    <Shear of 24 spherocylinders in 2D at gdot = 0.01, phi = 0.6: 21 frames to strain = 3, pressure = ..., in shear.h5>
    >>> found = run.steady()
    >>> found["rotation"].value > 0 and found["S_2"].value > 0
    True
    """

    @property
    def strain(self) -> FloatArray:
        """(T,) strains of the box since the start."""
        return self["pure_strain" if self.about["flow"] == "pure" else "shear_strain"]

    @property
    def gdot(self) -> float:
        """Rate, [1/time]."""
        return float(self.about["gdot"])

    @checked
    def steady(self, after: float | None = None) -> SteadyState:
        """Average over the steady state, without the start-up.

        Parameters
        ----------
        after : float, optional
            Strain from which to average; chosen by default.

        Returns
        -------
        SteadyState
            Averages by name, each with its error and the strain over which samples are correlated;
            see `jamshape.measures.steady`.

        Raises
        ------
        ValueError
            If fewer than 8 samples are left.
        """
        return steady_state(self.observables, self.strain, after)

    def __repr__(self) -> str:
        start = f"gdot = {self.gdot:g}, {_held(self)}"
        end = f"strain = {self.strain[-1]:.5g}, pressure = {self.pressure[-1]:.3g}"
        return f"<Shear of {self._who()} at {start}: {len(self)} frames to {end}{self._where()}>"


class CyclicShearFile(Recorded):
    """A cyclic shear in its H5MD file; parameters as in `Recorded`.

    Frames are of ends of cycles, at strain 0.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> run = js.cyclic_shear(rods, n=24, phi=0.8, amplitude=0.02, period=100, cycles=4, file="cycles.h5", progress=False)
    >>> run
    <Cyclic shear of 24 spherocylinders in 2D at phi = 0.8: 4 cycles to strains of +-0.02, displacement = ..., in cycles.h5>
    >>> run.displacement.shape, run.dissipated.shape, len(run)
    ((4,), (4,), 5)
    >>> cycles = run.cycles()
    >>> cycles[-1].number, cycles[-1].largest < cycles[0].largest, cycles[-1].storage > 0
    (4, True, True)
    """

    @property
    def strain(self) -> FloatArray:
        """(T,) strains of the box."""
        return self["pure_strain" if self.about["flow"] == "pure" else "shear_strain"]

    @property
    def stress(self) -> FloatArray:
        """(T,) stress that does work on the strain, [energy / length^D]; it is -p_xy, or p_yy - p_xx in pure shear."""
        return -self["normal_difference" if self.about["flow"] == "pure" else "p_xy"]

    @property
    def gdot(self) -> float:
        """Magnitude of the rate, 4 amplitude / period, [1/time]."""
        return QUARTERS * float(self.about["amplitude"]) / float(self.about["period"])

    @property
    def displacement(self) -> FloatArray:
        """(C,) mean squared displacement in each cycle, between its ends, [length^2]; 0 where particles return."""
        rows = int(self.about["rows"])
        return self["displacement"][rows::rows]

    @property
    def dissipated(self) -> FloatArray:
        """(C,) energy that the drag dissipates in each cycle over the volume at its start, by the trapezoidal rule, [energy / length^D]."""
        rows, period = int(self.about["rows"]), float(self.about["period"])
        yielding = self._yielding
        volume = np.ones(len(self.phi)) if yielding is None else yielding.volume
        power = self["dissipation"] * volume
        means = (power[1:] + power[:-1]) / 2
        whole = means[: len(means) // rows * rows].reshape(-1, rows)
        return np.asarray(whole.mean(axis=1) * period / volume[:-1:rows][: len(whole)])

    @property
    def _yielding(self) -> Yielding | None:
        """Normal pressures and volumes, where the height of the box yields."""
        return Yielding(self["p_yy"], 1 / self.phi) if "hold_pressure" in self.about else None

    @checked
    def cycles(self, tolerance: float = RETURNED, *, first: int = 1) -> list[Cycle]:
        """Describe all whole cycles: energies, storage and loss modulus, and whether particles return.

        All particles count in the distances, which are those of states that were kept: with `frames`, not all are.

        Parameters
        ----------
        tolerance : float
            Largest distance of a particle of a reversible cycle, over the smallest inner radius.
        first : int
            Number of the first cycle to describe, counted from 1 or, if negative, from the end.

        Returns
        -------
        list of Cycle
            ``number``, ``work``, ``lost``, ``storage`` and ``loss`` [energy / length^D], ``rms`` and ``largest``
            distance of particles from where the cycle began, the number of contacts that ``changed``, and
            ``is_reversible``; see `jamshape.measures.cycles`.
        """
        require_positive(tolerance=tolerance)
        frames, period = recorded_frames(self.file), float(self.about["period"])
        kept = {round(time / period): k for k, time in enumerate(frames.times.tolist())}
        rows = Rows(
            self.strain, self.stress, self.dissipated, int(self.about["rows"]), self._yielding
        )
        return cycles_of(rows, Ends(kept, frames, rattlers=True), tolerance, first)

    def __repr__(self) -> str:
        cycles = len(self.displacement)
        start = f"{_held(self)}: {cycles} cycles to strains of +-{self.about['amplitude']:g}"
        end = f", displacement = {self.displacement[-1]:.3g}" if cycles else ""
        return f"<Cyclic shear of {self._who()} at {start}{end}{self._where()}>"


class YieldStress(NamedTuple):
    """A yield stress with its error, [energy / length^D]."""

    value: float
    error: float


class QuasistaticShearFile(Recorded):
    """A quasistatic shear in its H5MD file; parameters as in `Recorded`.

    Row 0 is the minimised start. Frame 0 is the start itself.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> run = js.quasistatic_shear(rods, n=16, phi=0.95, step=2e-3, strain=0.2, file="aqs.h5", progress=False)
    >>> run
    <Quasistatic shear of 16 spherocylinders in 2D: 100 steps to strain = 0.2, phi = 0.95, stress = ..., in aqs.h5>
    >>> all(event.drop > 0 for event in run.events())
    True
    """

    @property
    def strain(self) -> FloatArray:
        """(T,) strains since the first minimum, of either sign."""
        return self["strain"]

    @property
    def steps_per_cycle(self) -> int:
        """Number of steps, and so of rows, of each cycle; 0 without cycles."""
        return QUARTERS * self._how.quarter if self._how.cycles else 0

    @checked
    def cycles(self, tolerance: float = RETURNED, *, first: int = 1) -> list[Cycle]:
        """Describe all whole cycles, as `CyclicShearFile.cycles`; none without an amplitude.

        Rattlers, whose places are arbitrary, do not count in the distances.

        Parameters
        ----------
        tolerance : float
            Largest distance of a particle of a reversible cycle, over the smallest inner radius.
        first : int
            Number of the first cycle to describe, counted from 1 or, if negative, from the end.

        Examples
        --------
        >>> import jamshape as js
        >>> discs = js.Spherocylinders(alpha=0)
        >>> packing = js.make_packing(discs, n=16, u0=1e-4, progress=False)
        >>> run = js.quasistatic_shear(start=packing, step=1e-5, amplitude=1e-4, cycles=2, progress=False)
        >>> cycle = run.cycles()[-1]
        >>> cycle.number, cycle.is_reversible, cycle.changed, abs(cycle.loss) < 1e-3 * abs(cycle.storage)
        (2, True, 0, True)
        """
        require_positive(tolerance=tolerance)
        per_cycle = self.steps_per_cycle
        if not per_cycle:
            return []
        frames = recorded_frames(self.file)
        # Frame 0 is the start before its minimisation.
        kept = {
            (step - 1) // per_cycle: k
            for k, step in enumerate(frames.steps.tolist())
            if step > 0 and (step - 1) % per_cycle == 0
        }
        done = (len(self.strain) - 1) // per_cycle
        p = self._how.hold_pressure
        yielding = Yielding(np.full(len(self.phi), p), 1 / self.phi) if p else None
        volume = yielding.volume if yielding else np.ones(len(self.phi))
        lost = (self["lost"] * volume)[1 : done * per_cycle + 1].reshape(done, per_cycle)
        lost = lost.sum(axis=1) / volume[:-1:per_cycle][:done]
        rows = Rows(self.strain, self.stress, lost, per_cycle, yielding)
        return cycles_of(rows, Ends(kept, frames, rattlers=False), tolerance, first)

    @property
    def _how(self) -> QuasistaticShear:
        """Settings of the run."""
        return QuasistaticShear.of(self.about)

    @property
    def stress(self) -> FloatArray:
        """(T,) dU/d(strain) over the volume, [energy / length^D]; the shear stress in simple shear."""
        return self["stress"]

    @checked
    def contact_changes(
        self, *, within: float | None = None, step_back: bool = False
    ) -> list[ContactChange]:
        """List the contacts that opened and closed between frames, or more closely; see `LadderFile.contact_changes`.

        The control parameter is the strain, and `within` relative to the larger strain of two frames. With `frames` of
        at least the number of steps, a run keeps the state of each.

        Parameters
        ----------
        within : float, optional
            Largest distance between the two strains that enclose a change.
        step_back : bool
            Whether to find out if changes are reversible.
        """
        how = self._how
        if how.stress_step and (within is not None or step_back):
            msg = "the run raises the stress, expected one that raises the strain for changes within a distance; leave it out"
            raise ValueError(msg)

        def bring(start: At, value: float) -> PackingLike:
            at, landscape = start.packing, Landscape(start.packing)
            return sheared(landscape, State.of(at), how, value - start.value).state.packing(at)

        strains = np.array([self.packing(k).time for k in range(1, len(self))])
        return self._changes(Search(bring, within, step_back=step_back), strains, first=1)

    @checked
    def events(self, least: float = 1e-2) -> list[Event]:
        """List the stress drops.

        Parameters
        ----------
        least : float
            Omit drops below this fraction of the largest stress.
        """
        require_number("least", least)
        return stress_drops(self.observables, least)

    @property
    def at_rest(self) -> BoolArray:
        """(T,) whether forces balance to the tolerance, or vanish, in each row; of an unfinished run, rows so far."""
        residual, u = read_report(self.file).error, self["u"]
        n = min(len(residual), len(u))
        least = Interaction.told(self.about).range_of("u0").low  # no force left to balance
        return np.asarray((residual[:n] <= self.about["tolerance"]) | (u[:n] <= least))

    def warn_unless_reached(self) -> None:
        """Warn if a minimisation after a step did not balance forces."""
        wrong = ~self.at_rest
        if wrong.any():
            largest = read_report(self.file).error[: len(wrong)][wrong].max()
            said = (
                f"forces do not balance in {wrong.sum()} of {len(wrong)} rows: net forces there are up to"
                f" {largest:.2g} of the mean force of a bond, expected at most {self.about['tolerance']:g};"
                " try a smaller {step:name} or another {seed:name}"
            )
            warnings.warn(NotReachedWarning(said, {"step": None, "seed": None}), stacklevel=3)

    @property
    def yield_stress(self) -> YieldStress | None:
        """Shear stress at which the packing begins to flow; None where strains are given, or none was reached.

        Half a step away from the largest stress that it resisted, and from the smallest that it did not.
        """
        step = self._how.stress_step
        if not (step and self.about.get("shear_flows")):
            return None
        return YieldStress((len(self["stress"]) - 1.5) * step, 0.5 * step)

    def modulus(self) -> float:
        """Slope of the stress in the first step, [energy / length^D]; that of the Hessian for small steps, NaN without a step."""
        if len(self.strain) < 2 or self.strain[1] == self.strain[0]:
            return math.nan
        return float((self.stress[1] - self.stress[0]) / (self.strain[1] - self.strain[0]))

    @checked
    def steady(self, after: float | None = None) -> SteadyState:
        """Average over the steady state, as in `ShearFile.steady`, along the strain of either sign; not of cycles."""
        if self._how.cycles:
            msg = f"the shear has {self._how.cycles} cycles, expected one strain without a turn for a steady state"
            raise ValueError(msg)
        return steady_state(self.observables, np.abs(self.strain), after)

    def __repr__(self) -> str:
        end = f"strain = {self.strain[-1]:.5g}, phi = {self.phi[-1]:.5g}, stress = {self.stress[-1]:.3g}"
        steps = len(self.strain) - 1
        return f"<Quasistatic shear of {self._who()}: {steps} steps to {end}{self._where()}>"


class LadderFile(Recorded):
    """A packing taken through values of a control parameter, in its H5MD file; parameters as in `Recorded`.

    Row and frame 0 are of the start, and the others of one value each. Rows contain ``u``, ``phi``, ``pressure``, ``z``,
    ``z_single``, ``rattlers``, ``contacts``, ``bonds`` and ``residual``.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> packing = js.make_packing(discs, n=16, u0=1e-4, file="dense.h5", progress=False)
    >>> run = js.ladder(packing, u0=[1e-5, 1e-6], file="ladder.h5", progress=False)
    >>> run
    <Ladder of 16 spherocylinders in 2D: 2 of 2 values to u0 = 1e-06, phi = 0.7..., z = ..., in ladder.h5>
    >>> run.values.shape, len(run), bool((run.phi[1:] < run.phi[:-1]).all())
    ((3,), 3, True)
    >>> change = run.contact_changes()[0]
    >>> change.change, change.after < change.before
    ('opened', True)
    """

    @property
    def parameter(self) -> str:
        """Name of the control parameter, ``u0`` or ``pressure``."""
        return str(self.about["ladder_parameter"])

    @property
    def values(self) -> FloatArray:
        """(T,) values of the control parameter, first that of the start and then the requested ones."""
        own = self[_OBSERVABLE_OF[self.parameter]]
        return np.concatenate([own[:1], self["goal"][1:]])

    def _numbers(self) -> IntArray:
        """(T, 2) numbers of contacts that opened and closed."""
        return np.array(numbers_of_changes(self._states(self.values)))

    @property
    def opened(self) -> IntArray:
        """(T,) number of contacts that opened on the way to each state from the one before."""
        return np.asarray(self._numbers()[:, 0])

    @property
    def closed(self) -> IntArray:
        """(T,) number of contacts that closed on the way to each state from the one before."""
        return np.asarray(self._numbers()[:, 1])

    @property
    def reached(self) -> BoolArray:
        """(T,) whether the value was reached; if not, the state is that of the row before."""
        return self["reached"] > 0

    @property
    def at_rest(self) -> BoolArray:
        """(T,) whether forces balance to the tolerance."""
        return np.asarray(self["residual"] <= self.about["tolerance"])

    def warn_unless_reached(self) -> None:
        """Warn if a value was not reached, or forces do not balance there."""
        wrong = ~(self.reached & self.at_rest)[1:]
        if wrong.any():
            values = ", ".join(f"{value:g}" for value in self.values[1:][wrong])
            said = (
                f"at {values} no minimum with balanced forces was found, expected one at each of {wrong.size} values;"
                f" give {{{self.parameter}:name}} more values between, or another start"
            )
            warnings.warn(NotReachedWarning(said, {self.parameter: None}), stacklevel=3)

    @checked
    def contact_changes(
        self, *, within: float | None = None, step_back: bool = False
    ) -> list[ContactChange]:
        """List the contacts that opened and closed from one state to the next.

        Contacts of rattlers are included. Images of a pair are counted, not distinguished.

        Parameters
        ----------
        within : float, optional
            Largest relative distance between the two values that enclose a change, such as 1e-6, reached by
            bisection with minimisations; by default the values of the run enclose them.
        step_back : bool
            Whether to find out if changes are reversible: the packing is taken back over each interval, and ``returns``
            says whether it has the same contacts again and no particle moved by more than 1e-3 radii.

        Returns
        -------
        list of ContactChange
            ``before`` and ``after`` (values of the control parameter), ``ids`` of the particles, ``bond`` (2 for the
            second bond of a side-to-side contact), ``change`` ("opened" or "closed") and ``returns``.

        Raises
        ------
        TargetError
            If no minimum is found between two states.

        Examples
        --------
        >>> import jamshape as js
        >>> discs = js.Spherocylinders(alpha=0)
        >>> packing = js.make_packing(discs, n=16, u0=1e-4, file="dense.h5", progress=False)
        >>> run = js.ladder(packing, u0=[1e-5], progress=False)
        >>> changes = run.contact_changes(within=1e-3)
        >>> all(0 < change.before / change.after - 1 <= 1e-3 for change in changes)
        True
        """
        how = Ladder.of(self.about)
        if within is not None:
            how = replace(how, accuracy=min(how.accuracy, _PART_OF_WITHIN * within))

        def to(start: At, value: float) -> PackingLike:
            at, landscape = start.packing, Landscape(start.packing)
            return bring(landscape, State.of(at), how.to(value)).state.packing(at)

        return self._changes(Search(to, within, True, step_back), self.values)

    def __repr__(self) -> str:
        done, asked = int(self.about["ladder_done"]), np.size(self.about["ladder_values"])
        end = f"{self.parameter} = {self.values[-1]:.3g}, phi = {self.phi[-1]:.6g}, z = {self['z'][-1]:.4g}"
        return f"<Ladder of {self._who()}: {done} of {asked} values to {end}{self._where()}>"


_OBSERVABLE_OF = {"u0": "u", "pressure": "pressure"}
"""Observable of a control parameter."""


def _held(run: ShearFile | CyclicShearFile) -> str:
    """Describe what a shear holds, its packing fraction or the normal pressure."""
    pressure = run.about.get("hold_pressure")
    return f"phi = {run.phi[0]:.5g}" if pressure is None else f"p_yy = {pressure:g}"


def _brought_along(kind: type[Recorded], name: str, content: bytes) -> Recorded:
    """Restore a pickled run that had no file of its own."""
    at = place(None, name)
    at.path.write_bytes(content)
    return kind(*at)
