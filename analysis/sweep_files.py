"""What the figures of a sweep share: its finished packings by alpha, averages, the axis of alpha.

A sweep is a folder of pyscripts/sweep.py; each packing in it is a file of pyscripts/make_packing.py.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import BoolArray
from jamshape.contacts import ContactNetwork, find_contacts, find_rattlers
from jamshape.files.h5md import read_attributes, read_observables, read_packing
from jamshape.packing import Packing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Okabe & Ito: colours that are told apart with any colour vision.
BLACK, ORANGE, SKY, GREEN, BLUE, RED = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
)
YELLOW = "#F0E442"
COLORS = (BLUE, RED, GREEN, ORANGE, SKY, BLACK)
MARKERS = "oDs^v*"

# How numbers of the paper are drawn, behind our own.
PAPER_STYLE: dict[str, Any] = {"fmt": "*", "color": BLACK, "mfc": YELLOW, "ms": 11, "zorder": 1.5}
PAPER_STYLE |= {"label": "paper, $N=1024$"}

# All samples of a figure agree in these.
ENSEMBLE = ("n", "size_ratio", "u0")
REACHED = ("converged", "sliding")  # outcomes with mechanical equilibrium; others stalled

# Ends of the names of files that may lie beside a packing and are none.
OTHERS = (".run.h5", ".search.h5", ".path.h5", ".modes.h5")

# On a logarithmic axis of alpha, discs stand this factor left of the smallest other alpha.
DISCS_LEFT_BY = 4.0


class Sample(NamedTuple):
    """One finished packing: its file and what is said of it there."""

    path: Path
    attributes: dict[str, Any]

    @property
    def reached(self) -> bool:
        """Whether it is in mechanical equilibrium."""
        return self.attributes["outcome"] in REACHED

    def number(self, name: str) -> float:
        """Look up an attribute that is a number."""
        value = np.asarray(self.attributes.get(name, "missing"))
        if value.ndim or value.dtype.kind not in "biuf":
            msg = f"{self.path}: has no number {name!r}, expected a packing of make_packing.py"
            raise ValueError(msg)
        return float(value)

    def contacts(self) -> tuple[Packing, ContactNetwork, BoolArray]:
        """Read the packing and find its contacts, with two bonds side to side, and its rattlers."""
        packing = read_packing(self.path)
        if packing.dimension != 2:
            msg = f"{self.path}: is three-dimensional, expected two dimensions"
            raise ValueError(msg)
        network = find_contacts(packing, sides=2)
        observables = read_observables(self.path)
        if "rattler_ids" not in observables:
            return packing, network, find_rattlers(packing, network)
        return packing, network, np.isin(packing.id, observables["rattler_ids"][-1])


Sweep = dict[float, list[Sample]]


def read_sweep(paths: Iterable[Path], *, with_stalled: bool = False) -> Sweep:
    """Find the finished packings in folders and files, by alpha in ascending order.

    Parameters
    ----------
    paths
        Folders, of which other files are left out, and files, which must be packings.
    with_stalled
        Keep packings whose minimisation did not reach equilibrium.

    Raises
    ------
    ValueError
        If there is none, a file is none, or they are of several ensembles.
    OSError
        If one cannot be read.
    """
    kept = finished(list(paths), with_stalled=with_stalled)
    for name in ENSEMBLE:
        values = sorted({sample.number(name) for sample in kept})
        if len(values) > 1:
            found = " and ".join(f"{value:g}" for value in values)
            msg = f"{name} is {found}, expected one ensemble; give the files of one"
            raise ValueError(msg)
    sweep: Sweep = {}
    for sample in sorted(kept, key=lambda s: (s.number("alpha"), s.number("seed"))):
        sweep.setdefault(sample.number("alpha"), []).append(sample)
    return sweep


def finished(paths: list[Path], *, with_stalled: bool) -> list[Sample]:
    """Find the finished packings in folders and files, at least one; arguments as `read_sweep`."""
    samples = [sample for path in paths for sample in _samples(path)]
    kept = [s for s in samples if with_stalled or s.reached]
    if not kept:
        places, n = ", ".join(map(str, paths)), len(samples)
        stalled = f" in equilibrium, of {n} that ended otherwise" if samples else ""
        msg = (
            f"{places}: no finished packing{stalled}, expected files of sweep.py or make_packing.py"
        )
        raise ValueError(msg)
    return kept


def _samples(path: Path) -> list[Sample]:
    """Read one file, or those of a folder that are packings."""
    if not path.is_dir():
        sample = Sample(path, read_attributes(path))
        if "outcome" not in sample.attributes:
            msg = f"{path}: has no attribute 'outcome', expected a packing of make_packing.py"
            raise ValueError(msg)
        return [sample]
    # Runs and searches that lead to a packing may still be written, and are then locked.
    files = [file for file in sorted(path.glob("*.h5")) if not file.name.endswith(OTHERS)]
    samples = [Sample(file, read_attributes(file)) for file in files]
    return [sample for sample in samples if "outcome" in sample.attributes]


def choose_alphas(
    sweep: Sweep, asked: list[float], usual: tuple[float, ...], most: int
) -> list[float]:
    """Select the alpha to draw: those asked for, else the usual ones, else some of all.

    Raises
    ------
    ValueError
        If one that is asked for is not there.
    """
    missing = [alpha for alpha in asked if alpha not in sweep]
    if missing:
        known = ", ".join(f"{alpha:g}" for alpha in sweep)
        msg = f"no packing has alpha = {missing[0]:g}, expected one of {known}"
        raise ValueError(msg)
    spread = np.unique(np.linspace(0, len(sweep) - 1, most).round().astype(int))
    return asked or [a for a in usual if a in sweep] or [list(sweep)[k] for k in spread]


class Mean(NamedTuple):
    """An average over samples with its standard error."""

    value: float
    error: float
    """NaN for one sample."""
    samples: int

    def report(self) -> dict[str, float | None]:
        """Return the numbers for JSON, which has no NaN."""
        return {name: plain(value) for name, value in self._asdict().items()}


def mean(values: ArrayLike) -> Mean:
    """Average over samples; NaN are left out, and an average of none is NaN."""
    array = np.asarray(values, np.float64)
    array = array[np.isfinite(array)]
    n = len(array)
    error = float(np.std(array, ddof=1) / np.sqrt(n)) if n > 1 else math.nan
    return Mean(float(array.mean()) if n else math.nan, error, n)


def plain(value: float) -> float | None:
    """Write NaN and infinity as the null of JSON."""
    return value if math.isfinite(value) else None


def samples_text(sweep: Sweep) -> str:
    """Name N and the number of samples, for a legend."""
    counts = sorted({len(samples) for samples in sweep.values()})
    n = next(iter(sweep.values()))[0].attributes["n"]
    number = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return rf"$N={n}$, {number} sample{'s' * (counts[-1] > 1)} each"


def discs_at(alphas: Iterable[float]) -> float:
    """Find where discs stand on a logarithmic axis of alpha."""
    return min((alpha for alpha in alphas if alpha > 0), default=1.0) / DISCS_LEFT_BY


def label_alpha_axis(axes: Axes, discs: float | None) -> None:
    """Make the axis of alpha logarithmic, with a tick for discs where there are any."""
    axes.set_xscale("log")
    axes.set_xlabel(r"aspect ratio $\alpha = A/R$")
    low, high = axes.get_xlim()
    if discs is None or discs < low:
        return
    decades = range(math.ceil(math.log10(discs * 2)), math.floor(math.log10(high)) + 1)
    ticks = [10.0**k for k in decades]
    minor = [m * 10.0**k for k in range(-9, 3) for m in range(2, 10)]
    minor = [tick for tick in minor if discs * 2 < tick < high]
    axes.set_xticks([discs, *ticks], ["0", *[f"$10^{{{k}}}$" for k in decades]])
    axes.set_xticks(minor, [""] * len(minor), minor=True)
    axes.set_xlim(low, high)
    axes.axvline(discs * 2, color="0.8", lw=0.8, ls=":", zorder=0)


def error_bars(axes: Axes, means: Mapping[float, Mean], discs: float | None, **style: Any) -> None:
    """Draw means at their alpha, discs where `discs_at` says or not at all, with error bars.

    A line, if the style has one, does not lead to the discs: to be round is not the limit of
    becoming round.
    """
    points = [(alpha, *m[:2]) for alpha, m in sorted(means.items()) if alpha > 0]
    if discs is not None and 0.0 in means:
        points = [(discs, *means[0.0][:2]), (discs, math.nan, math.nan), *points]
    x, y, error = np.array(points).reshape(-1, 3).T
    bars = error if np.isfinite(error).any() else None
    axes.errorbar(x, y, bars, **{"capsize": 2, "ms": 5, "lw": 1, "elinewidth": 1} | style)
