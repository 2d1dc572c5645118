"""One packing at several energies, a file each, brought from one to the next (`protocols.ladder`), up and down from its own.

If particles rearrange on the way, each rung reports the fraction of the original contacts.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.contacts import find_contacts, find_rattlers
from jamshape.files.h5md import read_attributes, read_packing, require_attributes
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import write_minimum
from jamshape.minima.target import Target, TargetError
from jamshape.packing import Packing
from jamshape.protocols.ladder import bring
from jamshape.protocols.make import is_done
from jamshape.shapes.shape import in_name

# Attributes that the packing and existing rungs must share.
_IDENTITY = (
    *("alpha", "exponent", "w1", "w2", "kinds", "n", "seed", "size_ratio", "protocol", "n_sweeps"),
)

# Attributes that describe the search for the packing itself, not for a rung.
_OF_SOURCE = ("strict", "n_negative", "n_kinked", "lowest_eigenvalue")


class Rung(NamedTuple):
    """One packing of a ladder."""

    path: Path
    u0: float
    made: bool
    """Whether it was made by this call."""
    failure: str
    """Reason why it is missing; empty if it exists."""


def climb(
    source: Path, energies: Iterable[float], folder: Path, target: Target | None = None
) -> Iterator[Rung]:
    """Relax a packing at other energies, resuming an earlier call.

    Parameters
    ----------
    source : Path
        A finished packing of `protocols.make`.
    energies : iterable of float
        Energy densities u0, in any order, [energy / length^D].
    folder : Path
        Folder for the rungs, named after the source and u0.
    target : Target, optional
        Accuracy; its u0 is ignored.

    Yields
    ------
    Rung
        Those above the energy of the source in ascending order, then those below in descending
        order, each relaxed from the one before. After a failure, the next starts from the
        last success.

    Raises
    ------
    ValueError
        If the source is not a finished packing, an energy is not positive, or an existing rung
        belongs to another packing.
    """
    if not is_done(source):
        msg = f"{source} does not exist, expected a packing of make_packing.py"
        raise ValueError(msg)
    stored = read_attributes(source)
    targets = sorted({replace(target or Target(), u0=u0) for u0 in energies}, key=lambda t: t.u0)
    own = stored.get("u0", stored["u"])
    up = [t for t in targets if t.u0 >= own]
    down = [t for t in reversed(targets) if t.u0 < own]
    for part in (up, down):
        last = source
        for goal in part:
            rung = _step(source, stored, last, folder, goal)
            yield rung
            last = last if rung.failure else rung.path


def rung_path(source: Path, u0: float, folder: Path) -> Path:
    """Return the path of one rung."""
    return folder / f"{source.stem}_u{in_name(u0)}.h5"


def _step(source: Path, stored: dict[str, Any], last: Path, folder: Path, goal: Target) -> Rung:
    """Make one rung from the one before, unless it exists."""
    out = rung_path(source, goal.u0, folder)
    if is_done(out):
        identity = {name: stored[name] for name in _IDENTITY if name in stored}
        require_attributes(out, identity | {"u0": goal.u0})
        return Rung(out, goal.u0, made=False, failure="")
    began, start = time.perf_counter(), read_packing(last)
    landscape = Landscape(start)
    try:
        minimum = bring(landscape, State.of(start), goal)
    except TargetError as error:
        return Rung(out, goal.u0, made=False, failure=str(error))
    shared = _shared(read_packing(source), minimum.state.packing(start))
    known = {name: value for name, value in stored.items() if not name.startswith(_OF_SOURCE)}
    attributes = known | {name: getattr(goal, name) for name in ("u0", "accuracy", "tolerance")}
    attributes |= {"ladder_source": source.name, "contacts_shared": shared}
    attributes |= {
        "evaluations": landscape.evaluations,
        "wall_seconds": time.perf_counter() - began,
    }
    write_minimum(out, landscape, minimum, attributes)
    return Rung(out, goal.u0, made=True, failure="")


def _shared(first: Packing, other: Packing) -> float:
    """Fraction of the contacts of one packing, without those of rattlers, that another one has."""
    network = find_contacts(first, sides=2)
    rattlers = find_rattlers(first, network)
    held = network.pairs[~rattlers[network.pairs].any(axis=1)]
    now = {tuple(pair) for pair in find_contacts(other, sides=2).pairs.tolist()}
    kept = [tuple(pair) in now for pair in held.tolist()]
    return float(np.mean(kept)) if kept else 1.0
