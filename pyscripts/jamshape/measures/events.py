"""Plastic events of quasistatic shear: where the stress drops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray


class Event(NamedTuple):
    """A stress drop, over one step of the strain or several in a row."""

    strain: float
    """Strain after which it begins."""
    stress: float
    """Stress before it, [energy / length^D]."""
    drop: float
    """Decrease of the stress, or increase as the strain falls, [energy / length^D]."""
    lost: float
    """Dissipated energy over the volume, [energy / length^D]."""
    steps: int


def stress_drops(observables: Mapping[str, FloatArray], least: float = 1e-2) -> list[Event]:
    """List the drops of the stress from one minimum to the next.

    A sheared packing resists increasingly until its minimum vanishes, or slides; consecutive steps in which the
    stress falls are one event. Where the strain falls, the stress that resists is negative, and drops are increases.

    Parameters
    ----------
    observables
        (T,) arrays ``strain``, ``stress`` and ``lost`` of a run of `jamshape.flow.quasistatic`.
    least : float
        Omit drops below this fraction of the largest stress.

    Returns
    -------
    list of Event

    Examples
    --------
    >>> import numpy as np
    >>> stress = np.array([0.0, 1.0, 2.0, 1.5, 0.5, 1.0, 0.999])
    >>> [event] = stress_drops({"strain": np.arange(7.0), "stress": stress, "lost": np.zeros(7)})
    >>> event
    Event(strain=2.0, stress=2.0, drop=1.5, lost=0.0, steps=2)
    """
    strain, stress, lost = (np.asarray(observables[name]) for name in ("strain", "stress", "lost"))
    # Of the strain in each step; 0 where the stress along it does not fall.
    sign = np.sign(np.diff(strain)).astype(int)
    falls = np.concatenate([[0], np.where(sign * np.diff(stress) < 0, sign, 0), [0]])
    turns = np.diff(falls) != 0
    begins = np.flatnonzero(turns & (falls[1:] != 0))
    ends = np.flatnonzero(turns & (falls[:-1] != 0))
    found = [
        Event(
            float(strain[a]), float(stress[a]), float(abs(stress[a] - stress[b])),
            float(lost[a + 1 : b + 1].sum()), int(b - a),
        )
        for a, b in zip(begins, ends, strict=True)
    ]  # fmt: skip
    bound = least * float(np.abs(stress).max(initial=0.0))
    return [event for event in found if event.drop > bound]
