"""Draw where on their surface particles touch: Fig. 10 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_contact_angles.py SWEEP [MORE.h5 ...] --out contact_angles.png

P(phi) is the probability density of a contact at the polar angle phi about the centre from the
spine, small and big particles together, a side-to-side contact counted once, midway. Bins are narrow
where contacts are many; the four quarters of a particle are taken as one. The last line of standard
output is one JSON object with the height of the peak and how much of P is on the flat sides.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from draw import outlines
from sweep_files import COLORS, Mean, Sample, choose_alphas, mean, read_sweep

from jamshape.arrays import FloatArray
from jamshape.measures.contact_statistics import angle_density, angle_edges, contact_angles

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PAPER_ALPHAS = (0.01, 0.12, 1.0)


class Curve(NamedTuple):
    """P(phi) at one alpha, averaged over samples."""

    edges: FloatArray
    """(B + 1,) degrees."""
    density: FloatArray
    """(B,) 1 / rad."""
    error: FloatArray
    """(B,), 0 for one sample."""
    samples: int
    n_contacts: int
    on_flat: Mean
    """Fraction of the angles that are on the flat sides."""

    @property
    def middles(self) -> FloatArray:
        """(B,) degrees."""
        middles: FloatArray = (self.edges[1:] + self.edges[:-1]) / 2
        return middles


def angles_of(sample: Sample) -> FloatArray:
    """Find the angles of one packing."""
    return contact_angles(*sample.contacts())


def curve(alpha: float, samples: list[Sample]) -> Curve:
    """Average P over samples in the same bins."""
    found = [angles_of(sample) for sample in samples]
    edges = angle_edges(np.concatenate(found))
    densities = np.array([angle_density(angles, edges).density for angles in found])
    error = densities.std(axis=0) / np.sqrt(max(len(found) - 1, 1))
    corner = np.arctan2(1, alpha)
    return Curve(
        np.degrees(angle_density(found[0], edges).edges),
        densities.mean(axis=0),
        error,
        len(found),
        sum(map(len, found)) // 2,
        mean([np.count_nonzero(angles > corner) / len(angles) for angles in found]),
    )


def draw_particle(axes: Axes) -> None:
    """Draw what the angle is, on a particle."""
    from matplotlib.patches import Arc, Polygon  # noqa: PLC0415 - not needed for --help

    body = outlines(np.zeros((1, 2)), np.array([[1.0, 0.0]]), 0.8, 1.0)[0]
    axes.add_patch(Polygon(body, facecolor="0.9", edgecolor="k", lw=0.8))
    axes.plot([-0.8, 1.8], [0, 0], "k", lw=0.8)
    axes.plot([0, 0.5], [0, 1], "k", lw=0.8)
    axes.plot(0.5, 1, "o", color=COLORS[1], ms=4)
    axes.add_patch(Arc((0, 0), 0.9, 0.9, theta1=0, theta2=np.degrees(np.arctan2(1, 0.5)), lw=0.8))
    axes.text(0.55, 0.25, r"$\varphi$", fontsize=9)
    axes.set(xlim=(-2, 2), ylim=(-1.15, 1.15), aspect="equal")
    axes.set_axis_off()


def draw(curves: dict[str, Curve], n: int, out: Path) -> None:
    """Draw P(phi) of each, by its name, with a band of one standard error."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(6, 4.3), dpi=200, layout="constrained")
    axes = figure.subplots()
    for k, (name, found) in enumerate(curves.items()):
        color = COLORS[k % len(COLORS)]
        label = f"{name} ({found.samples} sample{'s' * (found.samples > 1)})"
        axes.stairs(found.density, found.edges, color=color, lw=1.1, label=label, baseline=None)
        low, high = found.density - found.error, found.density + found.error
        axes.stairs(
            high,
            found.edges,
            baseline=np.maximum(low, 1e-9),
            fill=True,
            color=color,
            alpha=0.25,
            lw=0,
        )
    axes.axhline(1 / np.pi, color="0.4", ls=":", lw=1, label=r"discs, $1/\pi$", zorder=0)
    seen = np.concatenate([found.density[found.density > 0] for found in curves.values()])
    axes.set_yscale("log")
    axes.set(xlim=(0, 180), ylim=(max(seen.min() / 1.6, 3e-3), 4 * seen.max()))
    axes.set_xticks(range(0, 181, 30))
    axes.set_xlabel(r"angle $\varphi$ from the spine  [degrees]")
    axes.set_ylabel(r"density of contacts $P(\varphi)$  [1/rad]")
    axes.legend(
        title=f"$N={n}$",
        title_fontsize=8,
        fontsize=8,
        alignment="left",
        loc="upper left",
        frameon=False,
    )
    draw_particle(axes.inset_axes((0.72, 0.72, 0.26, 0.26)))
    figure.savefig(out)


def main() -> None:
    """Read, count, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    which = "of the curves (0.01, 0.12 and 1 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    parser.add_argument(
        "--out", type=Path, default=Path("contact_angles.png"), help="(%(default)s)"
    )
    options = parser.parse_args()
    sweep = read_sweep(options.packings)
    curves = {
        alpha: curve(alpha, sweep[alpha])
        for alpha in choose_alphas(sweep, options.alpha, PAPER_ALPHAS, most=5)
    }
    n = next(iter(sweep.values()))[0].attributes["n"]
    draw({rf"$\alpha={alpha:g}$": found for alpha, found in curves.items()}, n, options.out)
    rows = [
        {"alpha": alpha, "samples": found.samples, "contacts": found.n_contacts}
        | {"peak": found.density.max(), "on_flat": found.on_flat.report()}
        | {"peak_degrees": float(found.middles[np.argmax(found.density)])}
        for alpha, found in curves.items()
    ]
    print(json.dumps({"out": str(options.out), "contact_angles": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_contact_angles.py: {error}")
