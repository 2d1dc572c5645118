"""Contacts that open and close as a packing is taken through values of a control parameter, such as energy or strain.

States are minima at some values; between two of them an event is located by bisection, with further minimisations.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jamshape.contacts import find_contacts, find_rattlers
from jamshape.measures.nonaffine import relative_motion
from jamshape.packing import Packing
from jamshape.records import Record

OPENED, CLOSED = "opened", "closed"

RETURNED = 1e-3
"""Largest displacement of a particle that returned, over the smallest radius."""

Bond = tuple[int, int, int]
"""IDs of two particles, ascending, and the number of the bond between them, from 1."""


class ContactChange(NamedTuple):
    """A contact that opened or closed between two values of the control parameter."""

    before: float
    """Value of the control parameter before it, in the order of the run."""
    after: float
    """Value after it."""
    ids: tuple[int, int]
    """IDs of the two particles, ascending; equal for a particle and its own periodic image."""
    bond: int
    """Number of the bond between the two, from 1; 2 is the second bond of a side-to-side contact, or another image."""
    change: str
    """"opened" or "closed"."""
    returns: bool | None = None
    """Whether the packing returns to its state when it is taken back over this interval; None unless asked."""


@dataclass(frozen=True, eq=False)
class At(Record):
    """A state at a value of the control parameter."""

    value: float
    packing: Packing

    @cached_property
    def bonds(self) -> set[Bond]:
        """All bonds between particles, those of rattlers included.

        Images of a pair are counted, not distinguished: the vectors of a sheared box change.
        """
        network = find_contacts(self.packing)
        count: Counter[tuple[int, int]] = Counter()
        ids = np.sort(self.packing.id[network.pairs], axis=1)
        for pair, n in zip(ids.tolist(), network.n_bonds.tolist(), strict=True):
            count[pair[0], pair[1]] += n
        return {(i, j, k) for (i, j), n in count.items() for k in range(1, n + 1)}


@dataclass(frozen=True)
class Search:
    """Way to other values, and distance within which to enclose changes.

    Parameters
    ----------
    bring
        Function of a state and a value that returns the minimum there.
    within
        Largest distance between the two values that enclose a change, relative to them; none by default, for the
        states that there are.
    is_logarithmic
        Whether values span orders of magnitude, as energies do, and are halved by their geometric mean.
    step_back
        Whether to find out if changes are reversible.
    """

    bring: Callable[[At, float], Packing]
    within: float | None = None
    is_logarithmic: bool = False
    step_back: bool = False

    def to(self, start: At, value: float) -> At:
        """Bring a state to a value."""
        return At(value, self.bring(start, value))

    def between(self, low: At, high: At) -> float:
        """Return the value in the middle of two."""
        if self.is_logarithmic:
            return math.sqrt(low.value * high.value)
        return (low.value + high.value) / 2

    def is_close(self, low: At, high: At, scale: float) -> bool:
        """Whether two values enclose a change closely enough; `scale` is the largest of the values kept."""
        if self.within is None:
            return True
        if self.is_logarithmic:
            scale = min(low.value, high.value)
        middle = self.between(low, high)
        is_same = middle in {low.value, high.value}  # to the last bit
        return is_same or abs(high.value - low.value) <= self.within * scale


def contact_changes(states: Iterable[At], search: Search) -> list[ContactChange]:
    """List the contacts that open or close from one state to the next.

    Parameters
    ----------
    states : iterable of At
        Minima in the order of the run.
    search : Search

    Returns
    -------
    list of ContactChange
        In the order of the run; those between the same two values by their IDs.
    """
    found = []
    for low, high in pairwise(states):
        scale = max(abs(low.value), abs(high.value))
        for a, b in _enclosing(low, high, search, scale):
            changes = _changes(a, b)
            if changes and search.step_back:
                returns = _returns(a, search.to(b, a.value))
                changes = [change._replace(returns=returns) for change in changes]
            found += changes
    return found


def _enclosing(low: At, high: At, search: Search, scale: float) -> Iterator[tuple[At, At]]:
    """Yield neighbouring values with changes between, as close as requested."""
    if low.bonds == high.bonds:
        return
    if search.is_close(low, high, scale):
        yield low, high
        return
    middle = search.to(low, search.between(low, high))
    yield from _enclosing(low, middle, search, scale)
    yield from _enclosing(middle, high, search, scale)


def _changes(low: At, high: At) -> list[ContactChange]:
    """Compare two states."""
    return [
        ContactChange(
            low.value, high.value, (i, j), k, OPENED if (i, j, k) in low.bonds else CLOSED
        )
        for i, j, k in sorted(low.bonds ^ high.bonds)
    ]


def numbers_of_changes(states: Iterable[At]) -> list[tuple[int, int]]:
    """Return how many contacts opened and closed on the way to each state; none to the first."""
    pairs = pairwise(states)
    return [(0, 0), *((len(a.bonds - b.bonds), len(b.bonds - a.bonds)) for a, b in pairs)]


def _returns(start: At, back: At) -> bool:
    """Whether a state that was taken back has the contacts and the places of the one from which it came."""
    if start.bonds != back.bonds:
        return False
    held = ~find_rattlers(start.packing, find_contacts(start.packing))
    if not held.any():
        return True
    moved = relative_motion(start.packing, back.packing, held)
    largest = float(np.sqrt((moved**2).sum(axis=1)).max())
    return largest <= RETURNED * float(start.packing.inner_radius.min())
