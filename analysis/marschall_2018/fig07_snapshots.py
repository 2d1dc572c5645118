"""Draw packings side by side: Fig. 7 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_snapshots.py SWEEP [MORE.h5 ...] --out snapshots.png

Of each alpha the first sample: big particles blue, small ones green and rattlers grey; black lines
are along the spines, red dots where particles touch, two for a side-to-side contact. The last line of
standard output is one JSON object with what was counted.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from draw import BIG, CONTACT, RATTLER, SHORTEST, SMALL, images, outlines
from sweep_files import Sample, choose_alphas, read_sweep

from jamshape.arrays import BoolArray, FloatArray
from jamshape.contacts import ContactNetwork
from jamshape.packing import Packing

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_ALPHAS = (0.01, 4.0)
INCHES = 5.0


def colors(packing: Packing, rattlers: BoolArray) -> FloatArray:
    """Color by size, from green to blue, and rattlers grey: (N, 4)."""
    from matplotlib.colors import LinearSegmentedColormap, to_rgba  # noqa: PLC0415 - not for --help

    reach = packing.half_length + packing.radius
    size = np.interp(reach, [reach.min(), reach.max()], [0, 1])
    color = np.asarray(LinearSegmentedColormap.from_list("size", [SMALL, BIG])(size))
    color[rattlers] = to_rgba(RATTLER)
    return color


def draw_packing(
    axes: Axes, packing: Packing, network: ContactNetwork, rattlers: BoolArray
) -> None:
    """Draw the box and what is in it."""
    from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415 - not for --help

    box, A, R = packing.box, packing.half_length, packing.radius
    scale = INCHES / box.edges.max()
    line = np.clip(0.05 * 72 * scale * R.min(), 0.1, 1.0)  # points
    dot = np.clip(0.014 / scale, 0.15 * R.min(), 0.5 * R.min())
    i, center = images(packing.position, A[:, None] * np.abs(packing.axes) + R[:, None], box)
    bodies = list(outlines(center, packing.axes[i], A[i], R[i]))
    color = colors(packing, rattlers)[i]
    axes.add_collection(PolyCollection(bodies, facecolors=color, edgecolors="k", lw=line))
    half = (np.maximum(A, SHORTEST * R) * (A > 0))[i, None] * packing.axes[i]
    spines = list(np.stack([center - half, center + half], axis=1))
    axes.add_collection(LineCollection(spines, colors="k", lw=1.5 * line))
    i, center = images(network.bonds.point, np.full_like(network.bonds.point, dot), box)
    dots = list(outlines(center, np.eye(2)[0 * i], 0.0, dot))
    axes.add_collection(PolyCollection(dots, facecolors=CONTACT, lw=0))
    xlim, ylim = np.transpose([box.lo, box.lo + box.edges])
    axes.set(xlim=xlim, ylim=ylim, aspect="equal", xticks=[], yticks=[])


def draw(samples: dict[float, Sample], out: Path, dpi: int) -> list[dict[str, Any]]:
    """Draw one packing for each alpha; return what was counted."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    size = (INCHES * len(samples), INCHES + 0.3)
    figure = Figure(figsize=size, dpi=dpi, layout="constrained")
    panels = figure.subplots(1, len(samples), squeeze=False)[0]
    report = []
    for k, (axes, (alpha, sample)) in enumerate(zip(panels, samples.items(), strict=True)):
        packing, network, rattlers = sample.contacts()
        draw_packing(axes, packing, network, rattlers)
        known = {"n": packing.n, "phi": packing.phi, "rattlers": int(rattlers.sum())}
        text = rf"({'abcdefghij'[k % 10]}) $\alpha={alpha:g}$,  $N={packing.n}$,  "
        text += rf"$\phi={packing.phi:.4f}$,  {known['rattlers']} rattlers"
        axes.set_xlabel(text, fontsize=10)
        known["contacts"] = len(network.pairs)
        report.append(
            {"alpha": alpha, "file": str(sample.path), "seed": sample.number("seed")} | known
        )
    figure.savefig(out)
    return report


def main() -> None:
    """Read, find the contacts, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    which = "of the packings (0.01 and 4 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    parser.add_argument("--out", type=Path, default=Path("snapshots.png"), help="(%(default)s)")
    parser.add_argument("--dpi", type=int, default=200, help="dots per inch (%(default)s)")
    options = parser.parse_args()
    sweep = read_sweep(options.packings)
    samples = {
        alpha: sweep[alpha][0]
        for alpha in choose_alphas(sweep, options.alpha, PAPER_ALPHAS, most=2)
    }
    report = draw(samples, options.out, options.dpi)
    print(json.dumps({"out": str(options.out), "snapshots": report}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_snapshots.py: {error}")
