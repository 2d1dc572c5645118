"""Draw curvatures at contacts: Fig. 14 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_curvature.py SWEEP [MORE ...] --out curvature.png

Left the distribution of the Gaussian curvature K_G (abc)^(2/3) where particles touch, on both sides of each contact;
right its median with its quartiles against z_J. Spheres, of which it is 1, are not in the distribution. The last
line of standard output is one JSON object with quantiles and the rank correlation of median and z_J.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr
from superellipsoid_files import (
    Groups,
    Kind,
    averages,
    mark,
    packing_of,
    parser_of,
    pooled,
    read_groups,
    samples_text,
)
from sweep_files import Sample, plain

from jamshape.arrays import FloatArray
from jamshape.contacts import find_contacts
from jamshape.packing import body_axes
from jamshape.shapes.curvature import contact_curvatures

PER_DECADE = 6
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
SMALL = 0.1  # of a flat contact
FEWEST = 3  # shapes for a correlation


def curvatures(sample: Sample) -> FloatArray:
    """(2M,) K_G (abc)^(2/3) on both sides of all contacts."""
    packing = packing_of(sample)
    network = find_contacts(packing)
    first = np.searchsorted(network.bonds.contact, np.arange(len(network.pairs)))
    shape = (packing.diameters / 2, packing.exponent)
    axes = body_axes(packing.quaternions)
    return contact_curvatures(shape, axes, network.pairs, network.bonds.normal[first]).ravel()


Curvatures = dict[Kind, FloatArray]


def draw(groups: Groups, known: Curvatures, out: Path) -> None:
    """Draw distributions, and medians against z."""
    from matplotlib import colormaps  # noqa: PLC0415 - not needed for --help and for errors
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(11.5, 4.2), dpi=200, layout="constrained")
    left, right = figure.subplots(1, 2)
    z = averages(groups, "z")
    shades = colormaps["turbo"](np.linspace(0.05, 0.95, len(known)))
    for shade, (kind, values) in zip(shades, known.items(), strict=True):
        style: dict[str, Any] = mark(kind) | {"color": shade}
        positive = values[values > 0]
        if kind.family != "spheres" and len(positive):
            low, high = np.log10(positive.min()), np.log10(positive.max())
            first, last = np.floor(low * PER_DECADE), np.ceil(high * PER_DECADE) + 1
            edges = 10.0 ** (np.arange(first, last + 1) / PER_DECADE)
            count = np.histogram(positive, edges)[0]
            density = count / (len(values) * np.diff(edges))
            middle, filled = np.sqrt(edges[1:] * edges[:-1]), count > 0
            line = {"ms": 4, "lw": 1, "label": kind.label} | style
            left.plot(middle[filled], density[filled], ls="-", **line)
        quarter, half, rest = np.quantile(values, (0.25, 0.5, 0.75))
        bars = [[half - quarter], [rest - half]]
        style |= {"ls": "none", "ms": 6, "capsize": 2, "elinewidth": 0.8}
        right.errorbar([z[kind].value], [half], bars, **style)
    left.set(xscale="log", yscale="log", ylabel="$P(K_G)$")
    left.set_xlabel(r"$K_G=\bar K_G\,(abc)^{2/3}$ at contacts")
    if left.get_legend_handles_labels()[0]:
        text: dict[str, Any] = {"title_fontsize": 8, "fontsize": 8, "loc": "outside right center"}
        figure.legend(title=f"$(p, w_1, w_2)$\n{samples_text(groups)}", **text)
    right.set(yscale="log", xlabel="contacts per particle $z_J$")
    right.set_ylabel("median and quartiles of $K_G$")
    right.axhline(1, color="0.8", lw=0.8, ls=":", zorder=0)
    figure.savefig(out)


def row(kind: Kind, values: FloatArray) -> dict[str, Any]:
    """Describe the distribution of one shape."""
    quantiles = dict(zip(map(str, QUANTILES), np.quantile(values, QUANTILES).tolist(), strict=True))
    flat = float(np.mean(values < SMALL))
    return kind.report() | {"sides": len(values), "quantiles": quantiles, "below_0.1": flat}


def correlation(groups: Groups, known: Curvatures) -> dict[str, Any]:
    """Rank the medians of shapes that are no spheres, and z_J, against each other."""
    kinds = [kind for kind in known if kind.family != "spheres"]
    if len(kinds) < FEWEST:
        return {"shapes": len(kinds), "spearman": None}
    z = averages(groups, "z")
    medians = [np.median(known[kind]) for kind in kinds]
    found = spearmanr(medians, [z[kind].value for kind in kinds])
    return {"shapes": len(kinds), "spearman": plain(float(found.statistic))}


def main() -> None:
    """Read, measure, draw, report."""
    options = parser_of(__doc__, "curvature.png").parse_args()
    groups = read_groups(options.packings)
    known = {kind: pooled(curvatures(s) for s in samples) for kind, samples in groups.items()}
    draw(groups, known, options.out)
    found = [row(kind, values) for kind, values in known.items()]
    extra = {"with_z": correlation(groups, known)}
    print(json.dumps({"out": str(options.out), "curvature": found} | extra))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_curvature.py: {error}")
