"""What the figures of superellipsoids share: packings of sweeps by shape and protocol, averages, marks.

A sweep is a folder of files of pyscripts/make_packing.py --shape superellipsoid. Several may be given, such as
one of protocol 1 and one of protocol 2: packings belong together where shape, protocol and the sweeps of
protocol 2 agree.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from sweep_files import BLACK, BLUE, GREEN, ORANGE, RED, SKY, Mean, Sample, finished, mean

from jamshape.arrays import FloatArray
from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_packing
from jamshape.measures.order3d import directors, local_cubatic_order, local_nematic_order
from jamshape.packing import Packing, body_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PHI_SPHERES, Z_SPHERES = 0.64, 6.0  # the paper's
BETA_TICKS = (0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10)
PEAK = (0.05, 0.70, 0.74)  # asphericity at the peak of phi_J, and where phi_J lies there
LOCAL_ORDER = {"S2": r"local nematic order $S_2^\mathrm{loc}$"}
LOCAL_ORDER["C4"] = r"local cubatic order $C_4^\mathrm{loc}$"
OF_PAPER: dict[str, Any] = {"color": "0.5", "lw": 1, "ls": "--", "zorder": 0}

# beta this near to 1 is that of self-dual ellipsoids.
_DUAL = 0.02

# Marks of families, after Fig. 4 of the paper, with colors that are told apart with any colour vision.
_FAMILIES: dict[str, tuple[str, str]] = {
    "spheres": ("*", BLACK),
    "oblate ellipsoids": ("s", BLUE),
    "prolate ellipsoids": ("o", RED),
    "self-dual ellipsoids": ("^", GREEN),
    "general ellipsoids": ("v", SKY),
    "superballs": ("D", ORANGE),
}
_OF_EXPONENTS = (("p", "#CC79A7"), ("h", "#882255"), ("<", "#6B4C9A"), (">", "#8B5A2B"))


class Kind(NamedTuple):
    """What the packings of one point have in common."""

    p: float
    w1: float
    w2: float
    protocol: int = 1
    n_sweeps: int = 0
    """Of protocol 2."""

    @property
    def beta(self) -> float:
        """Reduced aspect ratio ac/b^2."""
        return self.w1 * self.w2

    @property
    def is_axisymmetric(self) -> bool:
        """Whether its z_iso is 10; a sphere is counted in."""
        return self.p == 1 and 1 in {self.w1, self.w2}

    @property
    def family(self) -> str:
        """Name the family of shapes, as in Fig. 4 of the paper."""
        round_one, round_two = self.w1 == 1, self.w2 == 1
        if self.p != 1:
            return "superballs" if round_one and round_two else f"$p={self.p:g}$"
        if round_one or round_two:
            which = {(True, True): "spheres", (False, True): "oblate ellipsoids"}
            return which.get((round_one, round_two), "prolate ellipsoids")
        return "self-dual ellipsoids" if abs(self.beta - 1) < _DUAL else "general ellipsoids"

    @property
    def label(self) -> str:
        """Name it in a legend."""
        text = f"$({self.p:g}, {self.w1:g}, {self.w2:g})$"
        return text if self.protocol == 1 else f"{text}, protocol 2, {self.n_sweeps:g} sweeps"

    def report(self) -> dict[str, Any]:
        """Return the numbers for JSON."""
        return self._asdict()


Groups = dict[Kind, list[Sample]]
Averages = dict[Kind, Mean]


def parser_of(doc: str | None, out: str) -> ArgumentParser:
    """Make the parser of a figure of sweeps."""
    parser = ArgumentParser(description=doc, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folders or files")
    parser.add_argument("--out", type=Path, default=Path(out), help="(%(default)s)")
    return parser


def read_groups(paths: Iterable[Path], *, with_stalled: bool = False) -> Groups:
    """Find the finished packings in folders and files, by shape and protocol in ascending order.

    Parameters
    ----------
    paths
        Folders, of which other files are left out, and files, which must be packings.
    with_stalled
        Keep packings whose minimisation did not reach equilibrium.

    Raises
    ------
    ValueError
        If there is none, a file is none of superellipsoids, or they are of several N.
    OSError
        If one cannot be read.
    """
    samples = finished(list(paths), with_stalled=with_stalled)
    sizes = sorted({sample.number("n") for sample in samples})
    if len(sizes) > 1:
        found = " and ".join(f"{size:g}" for size in sizes)
        msg = f"n is {found}, expected one ensemble; give the files of one"
        raise ValueError(msg)
    groups: Groups = {}
    for sample in sorted(samples, key=lambda s: (_kind(s), s.number("seed"))):
        groups.setdefault(_kind(sample), []).append(sample)
    return groups


def _kind(sample: Sample) -> Kind:
    p, w1, w2 = (sample.number(name) for name in ("p", "w1", "w2"))
    protocol = int(sample.number("protocol"))
    sweeps = int(sample.number("n_sweeps")) if protocol == 2 else 0
    return Kind(p, w1, w2, protocol, sweeps)


def averages(groups: Groups, name: str) -> Averages:
    """Average one attribute over the samples of each kind."""
    return {kind: mean([s.number(name) for s in samples]) for kind, samples in groups.items()}


def only(groups: Groups, chosen: Callable[[Kind], bool]) -> Groups:
    """Select kinds."""
    return {kind: samples for kind, samples in groups.items() if chosen(kind)}


def samples_text(groups: Groups) -> str:
    """Name N and the number of samples, for a legend."""
    counts = sorted({len(samples) for samples in groups.values()})
    n = int(next(iter(groups.values()))[0].number("n"))
    many = f"{counts[0]}" if len(counts) == 1 else f"{counts[0]} to {counts[-1]}"
    return rf"$N={n}$, {many} sample{'s' * (counts[-1] > 1)} each"


def mark(kind: Kind) -> dict[str, Any]:
    """Choose how points of a kind are drawn: open for protocol 1, filled for protocol 2."""
    names = ("0.75", "0.85", "1.5", "2")
    others = dict(zip(names, _OF_EXPONENTS, strict=True))
    marker, color = _FAMILIES.get(kind.family) or others.get(f"{kind.p:g}", ("X", BLACK))
    filled = kind.protocol == 2
    return {"marker": marker, "color": color, "mfc": color if filled else "none"}


def points(axes: Axes, x: Averages, y: Averages, **more: Any) -> None:
    """Draw averages against each other with their standard errors."""
    for kind in x:
        a, b = x[kind], y[kind]
        bars = [None if math.isnan(m.error) else m.error for m in (b, a)]
        style: dict[str, Any] = (
            {"ls": "none", "ms": 6, "capsize": 2, "elinewidth": 1} | mark(kind) | more
        )
        axes.errorbar([a.value], [b.value], bars[0], bars[1], **style)


def exactly(groups: Groups, value: Callable[[Kind], float]) -> Averages:
    """Give each kind a number that needs no average."""
    return {kind: Mean(value(kind), math.nan, len(samples)) for kind, samples in groups.items()}


def family_legend(axes: Axes, groups: Iterable[Kind], title: str, loc: str = "best") -> None:
    """Explain the marks that were drawn; "outside ..." is beside all axes of the figure."""
    from matplotlib.lines import Line2D  # noqa: PLC0415 - not needed for --help and for errors

    handles: dict[str, Line2D] = {}
    for kind in groups:
        text = kind.family + ", protocol 2" * (kind.protocol == 2)
        handles.setdefault(text, Line2D([], [], ls="none", ms=6, label=text, **mark(kind)))
    known, _ = axes.get_legend_handles_labels()
    every = [*handles.values(), *known]
    where: Any = axes.figure if loc.startswith("outside") else axes
    where.legend(handles=every, title=title, title_fontsize=8, fontsize=8, loc=loc)


def beta_axis(axis: Any) -> None:
    """Make an x or y axis of matplotlib that of beta: logarithmic, with ticks that can be read."""
    axis.set_label_text(r"reduced aspect ratio $\beta=ac/b^2$")
    getattr(axis.axes, f"set_{axis.axis_name}scale")("log")
    low, high = axis.get_view_interval()
    ticks = [tick for tick in BETA_TICKS if low / 1.01 < tick < 1.01 * high]
    axis.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)


def rows(groups: Groups, columns: dict[str, Averages]) -> list[dict[str, Any]]:
    """Report averages for JSON."""
    return [
        kind.report() | {name: values[kind].report() for name, values in columns.items()}
        for kind in groups
    ]


def local_order(packing: Packing) -> dict[str, FloatArray]:
    """(N,) S_2 and C_4 of the particles in contact with each (Appendix B); NaN without contacts."""
    axes, pairs = body_axes(packing.quaternions), find_contacts(packing).pairs
    director = directors(axes, packing.diameters / 2)
    return {
        "S2": local_nematic_order(director, pairs),
        "C4": local_cubatic_order(axes, pairs),
    }


def packing_of(sample: Sample) -> Packing:
    """Read the packing of a sample."""
    packing = read_packing(sample.path)
    if packing.dimension != 3 or packing.shape_style != "superellipsoid":
        msg = f"{sample.path}: holds no superellipsoids in 3D, expected them"
        raise ValueError(msg)
    return packing


def pooled(values: Iterable[FloatArray]) -> FloatArray:
    """Put the finite numbers of several arrays in one."""
    every = np.concatenate([np.ravel(v) for v in values])
    return np.asarray(every[np.isfinite(every)])
