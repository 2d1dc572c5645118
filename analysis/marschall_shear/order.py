"""Draw the order and the rotation of sheared rods against aspect ratio.

    python analysis/marschall_shear/order.py shears/*.h5 --out order.png

At the lowest rate: the nematic order S_2 in the most dilute and the densest flow and its largest value between, and the
rotation over the strain likewise, with its smallest value. Marschall, Keta, Olsson & Teitel, PRL 122, 188002 (2019), and
Marschall, Van Hoesen & Teitel, PRE 101, 032901 (2020), state that both are not monotonic in phi, that S_2 stays finite at jamming and above as alpha goes to 0, and that rods rotate above jamming. The
last line of standard output is one JSON object, where a number counts as larger if by more than two joint errors.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import scientific
from jamshape.measures.averages import Mean
from jamshape.measures.shears import ShearOf

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import error_bars, figure_of, label_alpha_axis
from common.sheared import by_alpha, exceeds, over_phi, slowest
from common.styles import color

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NONE = Mean(0.0, 0.0, 1)


class Course(NamedTuple):
    """A quantity against packing fraction."""

    first: Mean
    """At the smallest packing fraction."""
    extreme: Mean
    """Largest or smallest value."""
    last: Mean
    """At the largest packing fraction."""
    has_extreme: bool
    """Whether the extreme differs from both ends by more than two joint errors."""


def course_of(means: Mapping[float, Mean], *, is_peak: bool) -> Course:
    """Find the peak, or the dip, of a quantity by packing fraction."""
    values = list(means.values())
    extreme = (max if is_peak else min)(values, key=lambda m: m.value)
    ends = (values[0], values[-1])
    beyond = [exceeds(extreme, end) if is_peak else exceeds(end, extreme) for end in ends]
    return Course(values[0], extreme, values[-1], all(beyond))


def courses_of(alpha: float, runs: Sequence[ShearOf]) -> dict[str, Any]:
    """Describe the order and the rotation of one aspect ratio."""
    slow = slowest(runs)
    S_2 = course_of(over_phi(slow, "S_2"), is_peak=True)
    rotation = course_of(over_phi(slow, "rotation"), is_peak=False)
    return {
        "alpha": alpha, "gdot": slow[0].ensemble.gdot,
        "phi": [slow[0].ensemble.phi, slow[-1].ensemble.phi], "S_2": S_2, "rotation": rotation,
        "is_ordered": int(exceeds(S_2.last, NONE)), "rotates": int(exceeds(rotation.last, NONE)),
        "S_2_peaks": int(S_2.has_extreme), "rotation_dips": int(rotation.has_extreme),
    }  # fmt: skip


def figure_from(rows: Sequence[dict[str, Any]], runs: Sequence[ShearOf]) -> Figure:
    """Draw both quantities."""
    figure = figure_of(10, 4.2, dpi=100)
    left, right = figure.subplots(1, 2)
    _draw(left, rows, "S_2", "largest")
    _draw(right, rows, "rotation", "smallest")
    left.set_ylabel("nematic order $S_2$")
    right.set_ylabel(r"rotation $-\langle\dot\theta\rangle/\dot\gamma$")
    rates = sorted({row["gdot"] for row in rows})
    told = " and ".join(f"${scientific(rate)}$" for rate in rates)
    figure.suptitle(
        rf"spherocylinders in 2D, $N={runs[0].ensemble.n}$, size ratio {runs[0].ensemble.size_ratio:g}, steady shear,"
        rf" $\dot\gamma=$ {told}; bars: standard errors of correlated samples",
        fontsize=9,
    )
    return figure


def _draw(axes: Axes, rows: Sequence[dict[str, Any]], name: str, extreme: str) -> None:
    labels = {"first": "most dilute flow", "extreme": extreme, "last": "densest flow"}
    for k, (part, label) in enumerate(labels.items()):
        means = {row["alpha"]: getattr(row[name], part) for row in rows}
        error_bars(axes, means, None, fmt="osD"[k] + "-", color=color(k), label=label)
    label_alpha_axis(axes, None)
    axes.legend(fontsize=8)


def main(options: Namespace) -> None:
    """Read, compare, draw, report."""
    runs = {alpha: of for alpha, of in by_alpha(options.files).items() if alpha > 0}
    if not runs:
        msg = "all runs are of discs, which have no order, expected rods; add runs of some alpha"
        raise ValueError(msg)
    rows = [courses_of(alpha, of) for alpha, of in runs.items()]
    save_figure(figure_from(rows, [one for of in runs.values() for one in of]), options.out)
    counts = {
        name: sum(row[name] for row in rows)
        for name in ("is_ordered", "rotates", "S_2_peaks", "rotation_dips")
    }
    report({"out": options.out, "rods": len(rows), **counts, "courses": rows})


if __name__ == "__main__":
    run(parser_of(__doc__, "order.png", "RUN.h5"), main)
