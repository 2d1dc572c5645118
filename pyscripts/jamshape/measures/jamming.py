"""Packing fractions at which frames of a compression stay jammed when they are minimised.

The pressure of a flowing state rises much like that of a jammed one, so a line fitted to p(phi) finds an onset
of jamming only if states there stay jammed without driving.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from jamshape.checks import NotReachedWarning
from jamshape.contacts.network import CrossingError
from jamshape.landscape import Landscape
from jamshape.measures.averages import Mean
from jamshape.measures.onset import OnsetFit
from jamshape.minima import Outcome, Stop, minimise
from jamshape.packing import Packing, State

# Largest number of evenly spread frames that are minimised first; then those around the change.
_MOST = 32

_TOLERANCE = 1e-8  # residual at which minimisations stop, that of packings
_LOWEST = 1e-16  # energy density likewise, in units of k_e and length, of harmonic contacts some 1e-8 above phi_J
_EVALUATIONS = 100_000

_VERDICTS = {
    Outcome.UNJAMMED: False,
    Outcome.CONVERGED: True,
    Outcome.SLIDING: True,
    Outcome.KINK: True,
}

_NAMES = ("phi_unjams", "phi_jams", "frames_minimised", "frames_undecided")


class Tried(NamedTuple):
    """A minimised frame."""

    frame: int
    phi: float
    stays: bool | None
    """Whether it stays jammed; None if the minimisation did not finish."""

    def __str__(self) -> str:
        said = {True: "stays jammed", False: "unjams", None: "is undecided"}[self.stays]
        return f"frame {self.frame} at phi {self.phi:.6f} {said}"


class Jamming(NamedTuple):
    """Bracket of the packing fraction at which frames of a run stay jammed when minimised."""

    unjams: float
    """Packing fraction of the densest frame that unjams; NaN if none does."""
    jams: float
    """Packing fraction of the first denser frame that stays jammed; NaN if none does."""
    tried: int = 0
    """Number of minimised frames."""
    undecided: int = 0
    """Number of them neither at rest nor without energy at the end; they are ignored."""

    @classmethod
    def of(cls, tried: Iterable[Tried]) -> Jamming:
        """Bracket the change.

        Examples
        --------
        >>> Jamming.of([Tried(3, 0.87, True), Tried(2, 0.86, True), Tried(1, 0.85, False)])
        Jamming(unjams=0.85, jams=0.86, tried=3, undecided=0)
        """
        tried = list(tried)
        unjams = max((one.phi for one in tried if one.stays is False), default=math.nan)
        above = (one.phi for one in tried if one.stays and not one.phi <= unjams)
        undecided = sum(one.stays is None for one in tried)
        return cls(unjams, min(above, default=math.nan), len(tried), undecided)

    @classmethod
    def stored(cls, attributes: Mapping[str, Any]) -> Jamming | None:
        """Read it from the attributes of a run, if stored; else None."""
        if not set(_NAMES) <= attributes.keys():
            return None
        unjams, jams, *counts = (attributes[name] for name in _NAMES)
        return cls(float(unjams), float(jams), *map(int, counts))

    @property
    def phi_J(self) -> float:
        """Middle of the bracket; NaN if one end is unknown."""
        return (self.unjams + self.jams) / 2

    @property
    def phi_J_error(self) -> float:
        """Standard deviation of a uniform distribution in the bracket, its width over sqrt(12).

        Examples
        --------
        >>> round(Jamming(0.85, 0.86).phi_J_error, 4)
        0.0029
        """
        return (self.jams - self.unjams) / math.sqrt(12)

    def attributes(self) -> dict[str, Any]:
        """Return its numbers as attributes."""
        return dict(zip(_NAMES, self, strict=True))

    def text(self) -> str:
        """Describe the bracket, as the end of a sentence."""
        if math.isnan(self.unjams):
            none = "none of the frames unjams"
            return none if math.isnan(self.jams) else f"{none}, down to phi = {self.jams:.5f}"
        low = f"the frame at phi = {self.unjams:.5f} unjams"
        if math.isnan(self.jams):
            return f"{low} and no denser one stays jammed"
        return f"{low} and that at phi = {self.jams:.5f} stays jammed"

    def undecided_text(self) -> str:
        """Describe the frames that are ignored."""
        are = "is" if self.undecided == 1 else "are"
        return (
            f"{self.undecided} of {self.tried} minimised frames ended neither at rest nor without energy"
            f" and {are} ignored"
        )

    def warn_if_not_found(self) -> None:
        """Warn if an end of the bracket is unknown and minimisations did not finish."""
        if self.undecided and math.isnan(self.phi_J):
            said = f"{self.undecided_text()}: {self.text()}; record more {{frames:name}}"
            warnings.warn(NotReachedWarning(said, {"frames": None}), stacklevel=3)

    def differs(self, fit: OnsetFit) -> bool:
        """Whether an onset of p(phi) lies outside by more than its error."""
        low, high = fit.phi_J - fit.phi_J_error, fit.phi_J + fit.phi_J_error
        return high < self.unjams or low > self.jams  # comparisons with NaN are false

    def verdict(self, fit: OnsetFit | None, kappa: float) -> str:
        """Compare the onset of p(phi) with minimised frames, in one sentence.

        Examples
        --------
        >>> fit = OnsetFit(0.829, 0.003, 0.2, 10, 20)
        >>> print(Jamming(0.855, 0.858).verdict(fit, 1e-6))
        phi_J(kappa = 1e-06) = 0.829 +- 0.003 is the onset of flow and not of jamming: minimised, the frame at phi = 0.85500 unjams and that at phi = 0.85800 stays jammed.
        """
        ignored = f"; {self.undecided_text()}" if self.undecided else ""
        told = f"minimised, {self.text()}{ignored}."
        if fit is None:
            return f"p(phi) has no onset; {told}"
        onset = f"phi_J(kappa = {kappa:g}) = {Mean(*fit[:2]).text()}"
        if not self.differs(fit):
            return f"{onset} is borne out: {told}"
        if fit.phi_J > self.jams:
            return f"{onset} is not where jamming begins but later: {told}"
        return f"{onset} is the onset of flow and not of jamming: {told}"


def stays_jammed(packing: Packing, k_e: ArrayLike | None = None) -> bool | None:
    """Return whether a state keeps energy in balanced contacts when minimised at fixed box.

    Parameters
    ----------
    packing : Packing
        Minimised with two bonds side to side, whatever its law: with one there are no minima.
    k_e : float or (T, T) array_like, [energy], optional
        That of the packing's law by default.

    Returns
    -------
    bool or None
        None if the minimisation does not decide.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Spherocylinders(alpha=0)
    >>> packing = js.make_packing(discs, n=16, u0=1e-6, file="discs.h5", progress=False)
    >>> stays_jammed(packing)
    True
    """
    landscape, state = Landscape(packing, k_e, sides=2), State.of(packing)
    lowest = _LOWEST * landscape.stiffness / landscape.length**packing.dimension
    lowest *= landscape.law.over_harmonic(_LOWEST)
    stop = Stop(tolerance=_TOLERANCE, lowest=lowest, evaluations=_EVALUATIONS)
    try:
        found = minimise(landscape, state, "auto", stop)
        if found.outcome is Outcome.STALLED:
            found = minimise(landscape, found.state, "newton", stop)
    except CrossingError:  # deep overlaps have no gradient to follow
        return None
    return _VERDICTS.get(found.outcome)


def minimised_frames(
    count: int, read: Callable[[int], Packing], k_e: ArrayLike | None = None
) -> Iterator[Tried]:
    """Minimise frames of a compression from the densest down, until one unjams.

    Of more than 32 frames, evenly spread ones come first, then those around the change: so the result
    is the densest frame that unjams, up to rearrangements of frames in between.

    Parameters
    ----------
    count : int
        Number of frames.
    read : callable
        Returns a frame by its number, from 0.
    k_e : float or (T, T) array_like, [energy], optional
        By default that of the law of each frame.

    Yields
    ------
    Tried
    """

    def tried(frame: int) -> Tried:
        packing = read(frame)
        return Tried(frame, packing.phi, stays_jammed(packing, k_e))

    stride = max(1, math.ceil(count / _MOST))
    seen, unjams = set(), -1
    for frame in range(count - 1, -1, -stride):
        one = tried(frame)
        yield one
        seen.add(frame)
        if one.stays is False:
            unjams = frame
            break
    above = unjams + 2 * stride if unjams >= 0 else min(seen, default=0)
    for frame in range(min(above, count) - 1, unjams, -1):
        if frame in seen:
            continue
        one = tried(frame)
        yield one
        if one.stays is False:
            return
