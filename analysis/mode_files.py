"""What the figures of modes share: the files of analysis/modes.py by alpha and u0, bins, signs.

Modes that lower the energy, of negative eigenvalue, have no frequency. They are drawn apart, left of the
others, at sqrt(-lambda) on an axis that runs the other way.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray
from jamshape.files.h5md import FileFormatError
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.statistics import mean_in_bins
from jamshape.vibration.table import ModeTable, read_modes, tabulate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PER_DECADE = 8  # bins

# All packings of a figure agree in these.
ENSEMBLE = ("n", "size_ratio")

# Least width of the axes of unstable modes, over that of the others.
_LEAST_WIDTH = 0.16

# Heights on these axes between which errors are drawn.
_ERRORS = (0.02, 0.42)

# Least width of a gap for a legend, over that of the axes.
_ROOM = 0.25


class Key(NamedTuple):
    """What the packings of one curve have in common."""

    alpha: float
    u0: float

    def label(self, keys: Iterable[Key]) -> str:
        """Name what distinguishes it from others, for a legend."""
        parts = []
        keys = list(keys)
        if len({key.alpha for key in keys}) > 1 or len(keys) == 1:
            parts.append(rf"$\alpha={self.alpha:g}$")
        if len({key.u0 for key in keys}) > 1:
            parts.append(rf"$u={scientific(self.u0)}$")
        return ", ".join(parts)


Tables = dict[Key, list[ModeTable]]


def scientific(value: float) -> str:
    """Write a number as a power of ten in TeX, without dollars."""
    exponent = math.floor(math.log10(value) + 1e-9)
    factor = value / 10.0**exponent
    power = f"10^{{{exponent}}}"
    return power if abs(factor - 1) < 1e-6 else rf"{factor:.1f}\times {power}"


def short(value: float) -> str:
    """Write a number in TeX, as a power of ten where it is small."""
    return f"{value:.2g}" if 0.01 <= value < 100 else scientific(value)


def read_tables(paths: Iterable[Path]) -> Tables:
    """Read files of modes, and those in folders, by alpha and u0 in ascending order.

    Parameters
    ----------
    paths
        Folders, of which other files are left out, and files, which must be of modes.py.

    Raises
    ------
    ValueError
        If there is none, a file is none, or they are of several ensembles.
    OSError
        If one cannot be read.
    """
    paths = list(paths)
    tables = [table for path in paths for table in _tables(path)]
    if not tables:
        msg = f"{', '.join(map(str, paths))}: no modes, expected files of analysis/modes.py"
        raise ValueError(msg)
    for name in ENSEMBLE:
        values = sorted({number(table, name) for table in tables})
        if len(values) > 1:
            found = " and ".join(f"{value:g}" for value in values)
            msg = f"{name} is {found}, expected one ensemble; give the files of one"
            raise ValueError(msg)
    grouped: Tables = {}
    for table in sorted(tables, key=lambda t: (*key_of(t), number(t, "seed"))):
        grouped.setdefault(key_of(table), []).append(table)
    return grouped


def _tables(path: Path) -> list[ModeTable]:
    """Read one file, or those of a folder that are of modes."""
    if not path.is_dir():
        return [read_modes(path)]
    found = []
    for file in sorted(path.glob("*.h5")):
        try:
            found.append(read_modes(file))
        except (FileFormatError, OSError):
            continue  # packings, and files that are still written
    return found


def number(table: ModeTable, name: str) -> float:
    """Look up what the packing's file said."""
    value = np.asarray(table.attributes.get(f"packing_{name}", "missing"))
    if value.ndim or value.dtype.kind not in "biuf":
        msg = f"modes have no number {name!r} of their packing, expected one of make_packing.py"
        raise ValueError(msg)
    return float(value)


def key_of(table: ModeTable) -> Key:
    """Return alpha and u0 of a packing."""
    return Key(number(table, "alpha"), number(table, "u0"))


def samples_text(tables: Tables) -> str:
    """Name N, the number of samples and what all curves share, for a legend."""
    counts = sorted({len(samples) for samples in tables.values()})
    n = int(number(next(iter(tables.values()))[0], "n"))
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    text = rf"$N={n}$, {many} sample{'s' * (counts[-1] > 1)}" + " each" * (len(tables) > 1)
    alphas = {key.alpha for key in tables}
    return text if len(tables) == 1 or len(alphas) > 1 else rf"$\alpha={alphas.pop():g}$, {text}"


def stable(table: ModeTable) -> NDArray[np.bool_]:
    """Select modes of positive eigenvalue, beyond doubt."""
    return np.asarray(~table["is_translation"] & (table["sign"] > 0))


def unstable(table: ModeTable) -> NDArray[np.bool_]:
    """Select modes of negative eigenvalue, beyond doubt."""
    return np.asarray(~table["is_translation"] & (table["sign"] < 0))


def sizes(table: ModeTable) -> FloatArray:
    """Return sqrt(|lambda|) of all modes."""
    return np.asarray(np.sqrt(np.abs(table["eigenvalues"])))


def bin_edges(tables: Iterable[ModeTable], per_decade: int = PER_DECADE) -> FloatArray:
    """Bins of equal relative width around all frequencies, those of unstable modes too."""
    every = np.concatenate([sizes(t)[stable(t) | unstable(t)] for t in tables])
    if not len(every):
        msg = "no mode has an eigenvalue above its error, expected modes of a jammed packing"
        raise ValueError(msg)
    first = math.floor(per_decade * math.log10(every.min()))
    last = math.floor(per_decade * math.log10(every.max())) + 1
    edges: FloatArray = 10.0 ** (np.arange(first, last + 1) / per_decade)
    return edges


class Sides(NamedTuple):
    """Axes of a quantity against frequency: of unstable modes, if there are any, and of the others."""

    unstable: Axes | None
    stable: Axes

    def each(self) -> list[Axes]:
        """Return the axes that are there."""
        return [axes for axes in self if axes is not None]


def add_sides(figure: Figure, tables: Tables, n_rows: int = 1) -> list[Sides]:
    """Make rows of axes that share their frequencies, with labels but those of the quantities."""
    every = [table for samples in tables.values() for table in samples]
    limits = [_limits(every, select) for select in (unstable, stable)]
    decades = [0.0 if lim is None else math.log10(lim[1] / lim[0]) for lim in limits]
    if limits[1] is None:
        msg = "no mode has a positive eigenvalue, expected modes of a jammed packing"
        raise ValueError(msg)
    if limits[0] is None:
        panels = figure.subplots(n_rows, 1, squeeze=False, sharex="col")
        rows = [Sides(None, row[0]) for row in panels]
    else:
        ratio = max(decades[0] / decades[1], _LEAST_WIDTH)
        panels = figure.subplots(
            n_rows, 2, squeeze=False, sharex="col", sharey="row", width_ratios=[ratio, 1]
        )
        rows = [Sides(*row) for row in panels]
    for row in rows:
        _dress(row, limits)
    bottom = rows[-1]
    bottom.stable.set_xlabel(r"frequency  $\omega$  $[\sqrt{k_e}\,/\,2R_s]$")
    if bottom.unstable is not None:
        bottom.unstable.set_xlabel(r"$\sqrt{-\lambda}$,  $\lambda<0$")
    return rows


def _limits(tables: Sequence[ModeTable], select: Any) -> tuple[float, float] | None:
    """Frequencies of the modes that are selected, with some space."""
    found = np.concatenate([sizes(table)[select(table)] for table in tables])
    return (float(found.min()) / 2, float(found.max()) * 2) if len(found) else None


def _dress(row: Sides, limits: Sequence[tuple[float, float] | None]) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter  # noqa: PLC0415 - with the figure only

    for axes in row.each():
        axes.set_xscale("log")
        axes.xaxis.set_major_locator(LogLocator(numticks=99))
        axes.xaxis.set_minor_locator(LogLocator(subs=range(2, 10), numticks=99))
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.tick_params(axis="x", labelsize=9)
    if limits[1]:
        row.stable.set_xlim(*limits[1])
    if row.unstable is None or not limits[0]:
        return
    low, high = limits[0]
    row.unstable.set_xlim(high, low)
    row.unstable.set_facecolor("#f3f3f3")
    row.stable.tick_params(labelleft=False, left=False, which="both")
    row.unstable.spines["right"].set_visible(False)
    row.stable.spines["left"].set(linestyle=(0, (4, 3)), color="0.5")


class Asked(NamedTuple):
    """Command line of a figure of modes."""

    tables: Tables
    out: Path


def asked(doc: str | None, out: str) -> Asked:
    """Read the command line and the files it names; errors as `read_tables` and `selected`."""
    parser = ArgumentParser(description=doc, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("modes", type=Path, nargs="+", metavar="MODES", help="folder or files")
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help="only these (all)")
    parser.add_argument("--u0", type=float, nargs="+", default=[], help="only these (all)")
    parser.add_argument("--out", type=Path, default=Path(out), help="(%(default)s)")
    options = parser.parse_args()
    tables = selected(read_tables(options.modes), options.alpha, options.u0)
    return Asked(tables, options.out)


def selected(tables: Tables, alphas: Sequence[float], energies: Sequence[float]) -> Tables:
    """Select curves by alpha and u0; all where none is asked for.

    Raises
    ------
    ValueError
        If one that is asked for is not there.
    """
    for name, asked in (("alpha", alphas), ("u0", energies)):
        known = sorted({getattr(key, name) for key in tables})
        missing = [value for value in asked if not _is_among(value, known)]
        if missing:
            there = ", ".join(f"{value:g}" for value in known)
            msg = f"no modes have {name} = {missing[0]:g}, expected one of {there}"
            raise ValueError(msg)
    found = {
        key: samples
        for key, samples in tables.items()
        if (not alphas or _is_among(key.alpha, alphas))
        and (not energies or _is_among(key.u0, energies))
    }
    if not found:
        msg = "no modes have both that alpha and that u0, expected some"
        raise ValueError(msg)
    return found


def _is_among(value: float, others: Sequence[float]) -> bool:
    return any(math.isclose(value, other, rel_tol=1e-9) for other in others)


class Binned(NamedTuple):
    """Averages over all modes of all samples in bins of frequency; (bins,) each."""

    omega: FloatArray
    """Geometric middle."""
    value: FloatArray
    """NaN where there is no mode, so that lines end at gaps between bands."""
    error: FloatArray
    """Standard error; 0 for one mode."""


def binned(samples: Sequence[ModeTable], name: str, edges: FloatArray, *, below: bool) -> Binned:
    """Average a column over modes in bins, over unstable modes or over the others."""
    select = unstable if below else stable
    omega = np.concatenate([sizes(t)[select(t)] for t in samples])
    values = np.concatenate([np.asarray(t[name], np.float64)[select(t)] for t in samples])
    count = np.histogram(omega, edges)[0]
    average = mean_in_bins(values, omega, edges)
    square = mean_in_bins(values**2, omega, edges)
    error = np.sqrt(np.maximum(square - average**2, 0.0) / np.maximum(count - 1, 1))
    return Binned(np.sqrt(edges[1:] * edges[:-1]), average, error)


def draw_binned(
    row: Sides, samples: Sequence[ModeTable], name: str, edges: FloatArray, **style: Any
) -> None:
    """Draw averages of a column with standard errors on both sides."""
    shown: dict[str, Any] = {"mfc": "none", "ms": 4, "lw": 0.8, "elinewidth": 0.8, "capsize": 1.5}
    shown |= style
    for axes, below in ((row.stable, False), (row.unstable, True)):
        if axes is not None:
            found = binned(samples, name, edges, below=below)
            axes.errorbar(found.omega, found.value, np.nan_to_num(found.error), **shown)


def draw_errors(axes: Axes, tables: Tables, colors: Sequence[str]) -> None:
    """Draw every unstable mode, one below the other, with the errors of its eigenvalue.

    Black bars are bounds of the eigenvalue of the packing as it is, mostly too short to be seen; light ones
    estimate how far that is from the eigenvalue where the forces would balance. Bars that leave the
    axes on the right say that there even the sign may be another one.
    """
    rows = [
        (size, error, bound, colors[k % len(colors)])
        for k, samples in enumerate(tables.values())
        for table in samples
        for size, error, bound in zip(
            *(np.abs(values[unstable(table)]) for values in _errors(table)), strict=True
        )
    ]
    rows.sort(key=lambda row: row[0])
    low, high = _ERRORS
    style: dict[str, Any] = {"transform": axes.get_xaxis_transform()}
    for k, (size, error, bound, color) in enumerate(rows):
        height = low + (high - low) * (k + 0.5) / max(len(rows), 12)
        faint = 0.35 if len(rows) < 100 else 0.15
        for width, shade, lw in ((error, color, 0.9), (bound, "k", 1.6)):
            ends = np.sqrt(np.maximum([size - width, size + width], 1e-300))
            opacity = 1.0 if shade == "k" else faint
            axes.plot(ends, [height] * 2, "-", color=shade, lw=lw, alpha=opacity, **style)
        axes.plot(np.sqrt(size), height, "|", color=color, ms=3, mew=1, **style)
    note: dict[str, Any] = {"fontsize": 7, "color": "0.3", "ha": "center", "va": "bottom"}
    top = low + (high - low) * len(rows) / max(len(rows), 12)
    axes.text(0.5, top + 0.01, "each, with error", transform=axes.transAxes, **note)


def _errors(table: ModeTable) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Eigenvalues, how far they may be from those of the minimum, and bounds of their errors."""
    return table["eigenvalues"], np.nan_to_num(table["state_error"]), table.bound


def draw_legend(axes: Axes, samples: Iterable[ModeTable], **style: Any) -> None:
    """Draw a legend where the frequencies of these modes leave the widest gap."""
    omega = np.concatenate([sizes(table)[stable(table)] for table in samples])
    low, high = axes.get_xlim()
    ends = np.log10(np.concatenate([[low], np.sort(omega), [high]]))
    widest = int(np.argmax(np.diff(ends)))
    middle = 0.5 * (ends[widest] + ends[widest + 1])
    place = (middle - ends[0]) / (ends[-1] - ends[0])
    text: dict[str, Any] = {"fontsize": 8, "title_fontsize": 8, "frameon": False}
    if ends[widest + 1] - ends[widest] > _ROOM * (ends[-1] - ends[0]):
        axes.legend(loc="center", bbox_to_anchor=(place, 0.5), **text, **style)
    else:
        axes.legend(loc="best", **text, **style)


def table_of(packing: Packing, modes: Path | None) -> ModeTable:
    """Read modes with their vectors from a file, or find those of the packing.

    Raises
    ------
    ValueError
        If the file has no vectors, or is of other particles.
    """
    if modes is None:
        landscape, state = Landscape(packing), State.of(packing)
        matrix = dynamical_matrix(landscape, state)
        return tabulate(landscape, state, matrix, spectrum(matrix))
    table = read_modes(modes)
    if not table.vectors.size:
        msg = f"{modes}: holds no vectors, expected a file of modes.py --vectors"
        raise ValueError(msg)
    if table.coordinates.n_all != packing.n:
        msg = f"{modes}: is of {table.coordinates.n_all} particles, expected {packing.n}"
        raise ValueError(msg)
    return table


def pick_modes(
    table: ModeTable, numbers: Sequence[int], omegas: Sequence[float], per_band: Mapping[str, int]
) -> list[int]:
    """Choose modes by number or frequency, or else typical ones of the bands.

    Parameters
    ----------
    table : ModeTable
    numbers
        Rows of the table.
    omegas
        The modes with the nearest frequencies, by ratio; negative ones are sought among modes of
        negative eigenvalue, at -sqrt(-lambda).
    per_band
        Where neither is asked for: so many of each band, evenly by rank. Those of a band that is empty
        come from the next one.

    Raises
    ------
    ValueError
        If there is no such mode.
    """
    n = len(table["omega"])
    wrong = [k for k in numbers if not 0 <= k < n]
    if wrong:
        msg = f"there is no mode {wrong[0]}, expected one from 0 to {n - 1}"
        raise ValueError(msg)
    chosen = list(numbers) + [_nearest(table, omega) for omega in omegas]
    if chosen:
        return chosen
    left = 0
    for name in ("low", "middle", "high"):
        rows, count = table.in_band(name), per_band.get(name, 0) + left
        left = count if not len(rows) else 0
        by_size = rows[np.argsort(sizes(table)[rows])]
        places = (np.arange(count) + 0.5) / max(count, 1) * len(rows)
        chosen += [int(by_size[int(place)]) for place in places[: count - left]]
    return sorted(set(chosen))


def _nearest(table: ModeTable, omega: float) -> int:
    rows = np.flatnonzero(stable(table) if omega > 0 else unstable(table))
    if not len(rows):
        kind = "positive" if omega > 0 else "negative"
        msg = f"no mode has a {kind} eigenvalue, expected one near omega = {omega:g}"
        raise ValueError(msg)
    distance = np.abs(np.log(sizes(table)[rows] / abs(omega))) if omega else sizes(table)[rows]
    return int(rows[np.argmin(distance)])


def mode_text(table: ModeTable, mode: int) -> str:
    """Name a mode by its number and its frequency, or its eigenvalue if that is not positive."""
    value, bound = table["eigenvalues"][mode], table.bound[mode]
    if table["sign"][mode] > 0:
        return rf"mode {mode}: $\omega={short(np.sqrt(value))}$"
    if table["is_translation"][mode]:
        return f"mode {mode}: translation"
    size = f"-{scientific(-value)}" if value < 0 else scientific(value)
    return rf"mode {mode}: $\lambda={size}\pm {scientific(bound)}$"
