"""Draw the shear modulus of nearly round particles against pressure and asphericity.

    python analysis/brito_2018/shear_modulus.py LADDER [MORE ...] --out shear_modulus.png

G is the mean shear modulus over directions at a fixed volume, of packings that are led to several energies
(`energy_ladder.py`); G and the pressure p are given over the bulk modulus K, which removes units and laws. Means over packings, of
either sign of G, are fitted by G_0 + c p^beta up to --fit-to; errors are those of the bootstrap. G_0 is the modulus of a packing with one
more contact than it needs, which vanishes with N. Ikeda, Urbani & Zamponi, arXiv 1904.03018 (2019), state that G of particles that are
not round grows linearly above jamming, and that of round ones as the square root. Both meet where p is about Delta, the
aspect ratio less 1, if G = Delta^(1/2) g(p/Delta): the right panel. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import attribute_text, scientific, systems_text
from jamshape.files.ensembles import PackingFile, System

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of, log_bars
from common.ensembles import Groups, conditions, n_of, read_groups
from common.families import family
from common.moduli_fit import Average, average_of
from common.stressed import elasticity_of, mean_of
from common.styles import PAPER_LINE, marked
from common.text import bars_text, samples_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


class Shape(NamedTuple):
    """Packings of one shape at k energies."""

    system: System
    Delta: float
    samples: int
    p: FloatArray
    """(k,) means over K, ascending."""
    G: Average
    """Over K."""


def moduli_of(file: PackingFile) -> tuple[float, float]:
    """Return p/K and G/K of a packing at rest, else NaN; G is NaN where it is not defined."""
    if not file.reached:
        return float("nan"), float("nan")
    _, elastic = elasticity_of(file.packing())
    K = elastic.bulk.relaxed
    return file.number("pressure") / K, elastic.B.G_dc.relaxed / K


def shape_of(system: System, files: Sequence[PackingFile], fit_to: float) -> Shape:
    """Measure the packings of a shape and average at each energy."""
    seeds, energies = (sorted({file.number(name) for file in files}) for name in ("seed", "u0"))
    found = np.full((2, len(seeds), len(energies)), np.nan)
    for file in files:
        place = seeds.index(file.number("seed")), energies.index(file.number("u0"))
        found[:, *place] = moduli_of(file)
    p = mean_of(found[0])
    Delta = max(files[0].number("aspect_ratio") - 1, 0.0)
    return Shape(system, Delta, len(seeds), p, average_of(p, found[1], fit_to))


def figure_from(found: Sequence[Shape], title: str, fit_to: float) -> Figure:
    """Draw G against p with the fits, and the same in units of powers of Delta."""
    figure = figure_of(10.5, 4.8, dpi=90)
    left, right = figure.subplots(1, 2)
    for k, one in enumerate(found):
        style, fit = marked(k), one.G.fit
        name = rf"{family(one.system)}, $\Delta={one.Delta:.2g}$"
        power = "too few pressures for a fit"
        if np.isfinite(fit.beta):
            power = rf"$G_0+c\,p^{{{fit.beta:.2f}\pm{one.G.errors.beta:.2f}}}$"
            p = np.geomspace(one.p[0], fit_to, 60)
            left.plot(p, fit.G_0 + fit.c * p**fit.beta, lw=0.8, color=style["color"])
        _draw(left, one, 0.0, style | {"label": f"{name}: {power}"})
        if one.Delta > 0:
            _draw(right, one, 0.5, style | {"label": name})
    low, high = right.get_xlim()
    x = np.geomspace(max(low, 1e-4), high, 2)
    for slope, dashes in ((0.5, ":"), (1.0, "--")):
        guide: dict[str, Any] = PAPER_LINE | {"ls": dashes, "label": f"slope {slope:g}"}
        right.plot(x, 0.3 * x**slope, **guide)
    left.set(xlabel="pressure $p/K$", ylabel=r"shear modulus $\langle G\rangle/K$")
    right.set(xlabel=r"$p/(K\Delta)$", ylabel=r"$\langle G-G_0\rangle/(K\Delta^{1/2})$")
    for axes in (left, right):
        axes.set(xscale="log", yscale="log")
        axes.legend(fontsize=7)
    figure.suptitle(title, fontsize=8)
    return figure


def _draw(axes: Axes, one: Shape, power: float, style: dict[str, Any]) -> None:
    """Draw G, or for a power of Delta the rise above G_0 where it is above its error, in its units."""
    unit = one.Delta**power
    rise = one.G.G - (one.G.fit.G_0 if power else 0.0)
    error = one.G.error
    own = rise > (error if power else 0.0)
    x = one.p[own] / (one.Delta if power else 1.0)
    axes.errorbar(x, rise[own] / unit, log_bars(rise[own], error[own]) / unit, **style)


def title_of(groups: Groups) -> str:
    """Describe the packings and their energies."""
    energies = sorted({file.number("u0") for files in groups.values() for file in files})
    packings = {s: {file.number("seed") for file in files} for s, files in groups.items()}
    told = [systems_text(groups), attribute_text("size_ratio", conditions(groups))]
    told += [samples_text(n_of(groups), packings), r"$w_1=1/(1+\Delta)$"]
    told += [rf"$u_0={scientific(energies[0])}$ to ${scientific(energies[-1])}$"]
    return ", ".join(told) + bars_text(packings)


def row_of(one: Shape) -> dict[str, Any]:
    """Describe a shape in JSON."""
    fit, errors = one.G.fit, one.G.errors
    points = zip(one.p, one.G.G, one.G.error, strict=True)
    return {
        "family": family(one.system), "Delta": round(one.Delta, 9), "samples": one.samples,
        "beta": fit.beta, "beta_error": errors.beta, "G_0": fit.G_0, "G_0_error": errors.G_0,
        "c": fit.c, "c_error": errors.c,
        "points": [{"p": p, "G": G, "G_error": error} for p, G, error in points],
    }  # fmt: skip


def main(options: Namespace) -> None:
    """Read, measure, fit, draw, report."""
    groups = read_groups(options.files, needs=("aspect_ratio", "u0", "pressure"))
    found = [shape_of(system, files, options.fit_to) for system, files in groups.items()]
    found.sort(key=lambda one: one.Delta)
    save_figure(figure_from(found, title_of(groups), options.fit_to), options.out)
    told = {"conditions": conditions(groups), "fit_to": options.fit_to}
    report({"out": options.out} | told | {"shapes": [row_of(one) for one in found]})


if __name__ == "__main__":
    parser = parser_of(__doc__, "shear_modulus.png", "LADDER")
    parser.add_argument("--fit-to", type=float, default=1e-2, help="largest p/K (%(default)s)")
    run(parser, main)
