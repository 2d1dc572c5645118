"""Draw distributions of contact forces of round and of nearly round particles.

    python analysis/brito_2018/forces.py SWEEP [MORE ...] --out forces.png

The distribution of small forces f, over their mean, is taken as f^theta. theta is the maximum likelihood of the forces below
--below, with its error: 1 + theta = 1 / <ln(below / f)>. Of a smooth distribution with a finite P(0) it goes to 0 with the bound,
in proportion to it; JSON has it for several bounds. Brito, Ikeda, Urbani, Wyart & Zamponi, PNAS 115, 11736 (2018), state
that forces of hypostatic packings follow no power law, so that P(0) is finite and theta 0, unlike those of isostatic
packings of round particles. Bonds of rattlers are left out. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.contacts import Contacts
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile, System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.ensembles import conditions, read_groups
from common.families import family
from common.styles import marked
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SURE = 2.0  # errors
BOUNDS = (0.4, 0.2, 0.1, 0.05)
"""Largest forces of further fits, over the mean."""


class Forces(NamedTuple):
    """Forces of a system."""

    system: System
    Delta: float
    """Aspect ratio less 1."""
    f: FloatArray
    """(B,) magnitudes over their mean in each packing, ascending."""
    theta: float
    theta_error: float

    @property
    def has_power(self) -> int:
        """1 if theta is above 0 by more than two errors."""
        return int(self.theta > _SURE * self.theta_error)


def forces_of(file: PackingFile) -> FloatArray:
    """Return the (B,) magnitudes of the bond forces of a packing over their mean."""
    found = Contacts.of(file.packing())
    bonds = found.network.bonds
    held = ~found.rattlers[found.pairs[bonds.contact]].any(axis=1)
    size = np.linalg.norm(bonds.force[held], axis=1)
    return np.asarray(size / size.mean())


def exponent_of(f: FloatArray, below: float) -> tuple[float, float]:
    """Estimate theta of f^theta and its error from the forces below a bound.

    Examples
    --------
    >>> theta, error = exponent_of(0.2 * np.linspace(0, 1, 100001)[1:], 0.2)  # uniform
    >>> abs(theta) < 1e-3, round(error, 4)
    (True, 0.0032)
    """
    small = f[(f > 0) & (f <= below)]
    if len(small) < 2:
        return float("nan"), float("nan")
    slope = 1 / float(np.mean(np.log(below / small)))
    return slope - 1, slope / len(small) ** 0.5


def figure_from(found: Sequence[Forces], title: str, below: float) -> Figure:
    """Draw cumulative distributions on the left and theta on the right."""
    figure = figure_of(10.5, 4.4, dpi=90)
    left, right = figure.subplots(1, 2)
    for k, one in enumerate(found):
        style = marked(k, "-")
        label = rf"{family(one.system)}, $\Delta={one.Delta:.2g}$"
        fraction = np.arange(1, len(one.f) + 1) / len(one.f)
        left.plot(one.f, fraction, color=style["color"], ls=("-", "--")[k % 2], lw=1, label=label)
        right.errorbar(max(one.Delta, 1e-3), one.theta, one.theta_error, **style)
    left.axvline(below, color="0.6", lw=0.8, ls=":")
    left.set(xscale="log", yscale="log", xlim=(1e-4, 10), ylim=(1e-5, 1.3))
    left.set(
        xlabel=r"force over its mean, $f/\langle f\rangle$", ylabel="fraction of smaller forces"
    )
    right.axhline(0, color="0.6", lw=0.8, ls=":")
    right.set(xscale="log", ylabel=r"exponent $\theta$ of small forces")
    right.set_xlabel(r"$\Delta$, aspect ratio $-\,1$ (discs at $10^{-3}$); $w_1=1/(1+\Delta)$")
    figure.suptitle(title, fontsize=8)
    left.legend(fontsize=7)
    return figure


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    groups = read_groups(options.files, needs=("aspect_ratio",))
    found = []
    for system, files in groups.items():
        f = np.sort(np.concatenate([forces_of(file) for file in files]))
        Delta = files[0].number("aspect_ratio") - 1
        found.append(Forces(system, Delta, f, *exponent_of(f, options.below)))
    found.sort(key=lambda one: one.Delta)
    title = conditions_text(groups, bars=False)
    save_figure(figure_from(found, title, options.below), options.out)
    rows = [
        {"family": family(one.system), "Delta": round(one.Delta, 9), "bonds": len(one.f)}
        | {"theta": one.theta, "theta_error": one.theta_error, "has_power": one.has_power}
        | {"by_bound": [(below, *exponent_of(one.f, below)) for below in BOUNDS]}
        for one in found
    ]
    report({"out": options.out, "conditions": conditions(groups), "forces": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "forces.png", "SWEEP")
    parser.add_argument(
        "--below",
        type=float,
        default=0.1,
        help="largest force of the fit, over the mean (%(default)s)",
    )
    run(parser, main)
