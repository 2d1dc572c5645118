"""Draw where steady shear jams, and with how many contacts, against aspect ratio.

    python analysis/marschall_shear/onsets.py shears/*.h5 --packings packings/rods --out onsets.png

phi_J of shear is where the yield pressure of the fits p = p_0 + c gdot^b vanishes (`analysis/shear/flow_curves.py`), and where
these are too few where p / gdot diverges. z_J is the contact number at the lowest rate, interpolated at phi_J; Marschall &
Teitel, PRE 100, 032906 (2019), state that it is not monotonic in alpha and always below the isostatic 6. --packings adds
phi_J by compression. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import scientific
from jamshape.measures.averages import Mean
from jamshape.measures.shears import ShearOf

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages
from common.axes import discs_at, error_bars, figure_of, label_alpha_axis
from common.ensembles import read_groups
from common.flow_curves import ShearOnset, curves_of, shear_onset
from common.sheared import at_phi, by_alpha, exceeds, over_phi, slowest
from common.styles import PAPER_LINE, color

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Z_ISO = 6
_FEWEST = 3  # aspect ratios, to tell of a peak


class Onset(NamedTuple):
    """Jamming of a flow of one aspect ratio."""

    alpha: float
    fits: ShearOnset
    phi: Mean
    """phi_J, from yield pressures or else from the viscosity; NaN if neither is among the packing fractions of the runs."""
    z: Mean


def onset_of(alpha: float, runs: Sequence[ShearOf]) -> Onset:
    """Fit the runs of one aspect ratio."""
    fits = shear_onset(curves_of(runs))
    known = [one.ensemble.phi for one in runs]
    within = (m for m in fits[:2] if min(known) <= m.value <= max(known))
    phi_J = next(within, Mean(float("nan")))
    return Onset(alpha, fits, phi_J, at_phi(over_phi(slowest(runs), "z"), phi_J.value))


def figure_from(
    found: Sequence[Onset], compressed: dict[float, Mean], runs: Sequence[ShearOf]
) -> Figure:
    """Draw phi_J and z_J."""
    figure = figure_of(10, 4.2, dpi=100)
    left, right = figure.subplots(1, 2)
    discs = discs_at(one.alpha for one in found)
    shear = {one.alpha: one.phi for one in found if np.isfinite(one.phi.value)}
    contacts = {one.alpha: one.z for one in found if np.isfinite(one.z.value)}
    lines = [(left, shear, "o-", 0, "shear"), (right, contacts, "o-", 0, "shear")]
    lines.append((left, compressed, "D--", 1, "compression"))
    for axes, means, fmt, k, label in lines:
        if means:
            error_bars(axes, means, discs, fmt=fmt, color=color(k), label=label)
    right.axhline(Z_ISO, **PAPER_LINE)
    for axes, label in (
        (left, r"packing fraction $\phi_J$"),
        (right, "contacts per particle $z_J$"),
    ):
        label_alpha_axis(axes, discs)
        axes.set_ylabel(label)
    left.legend(fontsize=8)
    rates = sorted({one.ensemble.gdot for one in runs})
    figure.suptitle(
        rf"spherocylinders in 2D, $N={runs[0].ensemble.n}$, size ratio {runs[0].ensemble.size_ratio:g}, steady shear,"
        rf" $\dot\gamma={scientific(rates[0])}$ to ${scientific(rates[-1])}$; bars: errors of the fits",
        fontsize=9,
    )
    return figure


def summary(found: Sequence[Onset]) -> dict[str, Any]:
    """Count what the paper states; discs have another isostatic number."""
    rods = [one for one in found if one.alpha > 0 and np.isfinite(one.z.value)]
    z_J = [one.z for one in rods]
    inner = [z for z in z_J[1:-1] if exceeds(z, z_J[0]) and exceeds(z, z_J[-1])]
    counts = {"rods": len(rods), "hypostatic": sum(z.value < Z_ISO for z in z_J)}
    rows = [
        {"alpha": one.alpha, "phi_J": one.phi, "z_J": one.z} | one.fits._asdict() for one in found
    ]
    peaks = int(bool(inner)) if len(z_J) >= _FEWEST else None
    return {"onsets": rows, **counts, "z_J_peaks": peaks}


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    runs = by_alpha(options.files)
    found = [onset_of(alpha, of) for alpha, of in runs.items()]
    compressed: dict[float, Mean] = {}
    if options.packings:
        means = averages(read_groups(options.packings), "phi_J")
        compressed = {system.number("alpha"): mean for system, mean in means.items()}
    every = [one for of in runs.values() for one in of]
    save_figure(figure_from(found, compressed, every), options.out)
    rows = [{"alpha": alpha, "phi_J": mean} for alpha, mean in compressed.items()]
    report({"out": options.out, **summary(found), "compressed": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "onsets.png", "RUN.h5")
    parser.add_argument("--packings", type=Path, nargs="+", metavar="SWEEP", help="compressed rods")
    run(parser, main)
