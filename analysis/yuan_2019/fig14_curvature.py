"""Draw curvatures at contacts: Fig. 14 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/yuan_2019/fig14_curvature.py SWEEP [MORE ...] --out curvature.png

Left the distribution of the Gaussian curvature K_G (abc)^(2/3) where particles touch, on both sides of each contact;
right its median with its quartiles against z_J. Spheres, of which it is 1, are not in the distribution. The last
line of standard output is one JSON object with quantiles and the rank correlation of median and z_J.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.stats import spearmanr

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.contacts import find_contacts
from jamshape.drawing.saving import save_figure
from jamshape.files.sets import PackingFile, System
from jamshape.packing import body_axes

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages
from common.axes import figure_of
from common.curvature import contact_curvatures
from common.ensembles import Groups, conditions, read_groups
from common.families import NEEDS, SPHERES, family, label, mark
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PER_DECADE = 6
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
SMALL = 0.1  # of a flat contact
FEWEST = 3  # shapes for a correlation

Curvatures = dict[System, FloatArray]


def curvatures(file: PackingFile) -> FloatArray:
    """(2M,) K_G (abc)^(2/3) on both sides of all contacts."""
    packing = file.packing()
    network = find_contacts(packing)
    first = np.searchsorted(network.bonds.contact, np.arange(len(network.pairs)))
    shape = (packing.diameters / 2, packing.exponent)
    axes = body_axes(packing.quaternions)
    found = contact_curvatures(shape, axes, network.pairs, network.bonds.normal[first]).ravel()
    return np.asarray(found[np.isfinite(found)])


def draw_distribution(axes: Axes, values: FloatArray, **style: Any) -> None:
    """Draw a distribution in bins of equal relative width."""
    positive = values[values > 0]
    low, high = np.log10(positive.min()), np.log10(positive.max())
    first, last = np.floor(low * PER_DECADE), np.ceil(high * PER_DECADE) + 1
    edges = 10.0 ** (np.arange(first, last + 1) / PER_DECADE)
    count = np.histogram(positive, edges)[0]
    density = count / (len(values) * np.diff(edges))
    middle, filled = np.sqrt(edges[1:] * edges[:-1]), count > 0
    line: dict[str, Any] = {"ls": "-", "ms": 4, "lw": 1} | style
    axes.plot(middle[filled], density[filled], **line)


def draw(groups: Groups, known: Curvatures, options: Namespace) -> None:
    """Draw distributions, and medians against z."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors

    figure = figure_of(11.5, 4.2)
    left, right = figure.subplots(1, 2)
    z, shades = averages(groups, "z"), colormaps["turbo"](np.linspace(0.05, 0.95, len(known)))
    named: set[System] = set()
    for shade, (system, values) in zip(shades, known.items(), strict=True):
        style: dict[str, Any] = mark(system) | {"color": shade}
        if family(system) != SPHERES and (values > 0).any():
            draw_distribution(left, values, label=label(system), **style)
            named.add(system)
        quarter, half, rest = np.quantile(values, (0.25, 0.5, 0.75))
        bars = [[half - quarter], [rest - half]]
        style |= {"ls": "none", "ms": 6, "capsize": 2, "elinewidth": 0.8}
        name = "" if system in named else label(system)
        right.errorbar([z[system].value], [half], bars, **style, label=name)
    left.set(xscale="log", yscale="log", ylabel="$P(K_G)$")
    left.set_xlabel(r"$K_G=\bar K_G\,(abc)^{2/3}$ at contacts")
    right.set(yscale="log", xlabel="contacts per particle $z_J$")
    right.set_ylabel("median and quartiles of $K_G$")
    right.axhline(1, color="0.8", lw=0.8, ls=":", zorder=0, label="spheres")
    text: dict[str, Any] = {"title_fontsize": 8, "fontsize": 8, "loc": "outside right center"}
    figure.suptitle(conditions_text(groups, bars=False), fontsize=8)
    figure.legend(title="$(p, w_1, w_2)$", **text)
    save_figure(figure, options.out)


def row_of(system: System, values: FloatArray) -> dict[str, Any]:
    """Describe the distribution of one shape."""
    quantiles = dict(zip(map(str, QUANTILES), np.quantile(values, QUANTILES), strict=True))
    flat = float(np.mean(values < SMALL))
    return system.report() | {"sides": len(values), "quantiles": quantiles, "below_0.1": flat}


def correlation(groups: Groups, known: Curvatures) -> dict[str, Any]:
    """Rank the medians of shapes that are no spheres, and z_J, against each other."""
    systems = [system for system in known if family(system) != SPHERES]
    if len(systems) < FEWEST:
        return {"shapes": len(systems), "spearman": None}
    z = averages(groups, "z")
    medians = [np.median(known[system]) for system in systems]
    found = spearmanr(medians, [z[system].value for system in systems])
    return {"shapes": len(systems), "spearman": float(found.statistic)}


def main(options: Namespace) -> None:
    """Read, measure, draw, report."""
    groups = read_groups(options.files, needs=(*NEEDS, "z"))
    known = {s: np.concatenate([curvatures(f) for f in files]) for s, files in groups.items()}
    draw(groups, known, options)
    found = [row_of(system, values) for system, values in known.items()]
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"curvature": found, "with_z": correlation(groups, known)})


if __name__ == "__main__":
    run(parser_of(__doc__, "curvature.png", "SWEEP"), main)
