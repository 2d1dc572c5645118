"""Powers of phi - phi_J under several laws of contacts: pressure, frequency, contacts and moduli of discs.

    python analysis/stress/law_scaling.py --n 64 256 --samples 40 --out law_scaling.png

The energy of a contact is k_e / A times its overlap to the A, A = 2 harmonic and 5/2 of Hertz. Each packing is made just above jamming, and led
to one larger energy after the other; phi_J is extrapolated from the first one. The expected powers of phi - phi_J are A - 1 of the
pressure, (A - 2) / 2 of the frequency, A - 2 of the bulk modulus, A - 3/2 of the shear modulus, and 1/2 of z - z_iso whatever the law (O'Hern,
Silbert, Liu & Nagel, Phys. Rev. E 68, 011306 (2003)). The frequency omega is the root mean square of all modes, that of a bond. The shear
modulus is averaged over the directions of shear. Lines are fitted to the logarithms of averages over packings between --fit; errors are
those of the bootstrap over packings. Finished packings are kept in --runs: a command that is stopped and repeated goes on. The last
line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.shapes.shape import power_of

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.laws import COMPRESSED, Series
from common.stressed import (
    Table,
    add_folder,
    draws,
    found_of,
    mean_and_error,
    mean_of,
    rows_of,
    write_table,
)
from common.styles import marked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LABELS = {
    "pressure": r"pressure $p$  $[k_e/(2R)^2]$",
    "omega": r"rms frequency $\omega$  $[\sqrt{k_e}/2R]$",
    "excess": r"$z-z_{\rm iso}$",
    "bulk": r"bulk modulus $B$  $[k_e/(2R)^2]$",
    "shear": r"shear modulus $G$  $[k_e/(2R)^2]$",
}
"""Measured numbers, with their axes."""


def expected(law: str) -> dict[str, float]:
    """Return the expected powers of phi - phi_J."""
    A = power_of(law)
    powers = {"pressure": A - 1, "omega": A / 2 - 1, "excess": 0.5}
    return powers | {"bulk": A - 2, "shear": A - 1.5}


class Power(NamedTuple):
    """A fitted power with its error."""

    value: float
    error: float


class Scaling(NamedTuple):
    """Averages of packings of one law and size."""

    law: str
    n: int
    samples: int
    distance: FloatArray
    """(k,) mean phi - phi_J by energy."""
    means: dict[str, FloatArray]
    """(k,) each."""
    errors: dict[str, FloatArray]
    """(k,) standard errors."""
    powers: dict[str, Power]


def slope(x: FloatArray, y: FloatArray, span: tuple[float, float]) -> float:
    """Fit log y to log x, of the points in a span of x where y is positive; NaN from fewer than two."""
    of = (x >= span[0]) & (x <= span[1]) & (y > 0)
    if of.sum() < 2:
        return float("nan")
    return float(np.polyfit(np.log(x[of]), np.log(y[of]), 1)[0])


def scaling_of(law: str, n: int, table: Table, spans: Mapping[str, tuple[float, float]]) -> Scaling:
    """Average and fit."""
    x = table.column("distance")
    columns = {name: table.column(name) for name in LABELS}
    chosen = list(draws(len(x)))[::5]
    powers = {}
    for name, y in columns.items():
        drawn = np.array([slope(mean_of(x[k]), mean_of(y[k]), spans[name]) for k in chosen])
        known = drawn[np.isfinite(drawn)]
        value = slope(mean_of(x), mean_of(y), spans[name])
        powers[name] = Power(value, float(known.std()) if len(known) else float("nan"))
    found = {name: mean_and_error(y) for name, y in columns.items()}
    means, errors = ({name: found[name][k] for name in found} for k in (0, 1))
    return Scaling(law, n, len(x), mean_of(x), means, errors, powers)


def figure_from(found: list[Scaling]) -> Figure:
    """Draw each number against phi - phi_J, with lines of the expected powers."""
    figure = figure_of(12, 7.4, dpi=130)
    places = figure.subplots(2, 3).ravel()
    for axes, (name, label) in zip(places, LABELS.items(), strict=False):
        for k, of in enumerate(found):
            style, y = marked(k), of.means[name]
            own = y > 0
            power = of.powers[name]
            text = f"{of.law}, $N={of.n}$: {power.value:.3f}$\\pm${power.error:.3f}"
            axes.errorbar(of.distance[own], y[own], of.errors[name][own], **style, label=text)
            if own.any():
                at = np.flatnonzero(own)[-1]
                line = y[at] * (of.distance / of.distance[at]) ** expected(of.law)[name]
                axes.plot(of.distance, line, "-", lw=0.8, color=style["color"])
        axes.set(xscale="log", xlabel=r"$\phi-\phi_J$", ylabel=label)
        axes.set_yscale("log" if axes.dataLim.y1 > 0 else "linear")  # few packings have no excess
        axes.legend(fontsize=7)
    places[-1].axis("off")
    laws = ", ".join(dict.fromkeys(of.law for of in found))
    sizes = ", ".join(str(n) for n in dict.fromkeys(of.n for of in found))
    figure.suptitle(
        rf"discs in 2D, $\alpha=0$, contacts {laws}, $N={sizes}$, {found[0].samples} packings each, size ratio 1.4,"
        "\ncompressed from just above jamming; marks: means, with fitted powers; bars: standard errors by the bootstrap; lines: expected powers",
        fontsize=9,
    )
    return figure


def summary(of: Scaling) -> dict[str, Any]:
    """Describe a law and size in JSON."""
    powers = {
        name: {"power": power.value, "error": power.error, "expected": expected(of.law)[name]}
        for name, power in of.powers.items()
    }
    points = [
        {"distance": x} | {name: y[k] for name, y in of.means.items()}
        for k, x in enumerate(of.distance)
    ]
    return {"law": of.law, "n": of.n, "samples": of.samples, "powers": powers, "points": points}


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "law_scaling.png")
    found.add_argument(
        "--laws", nargs="+", default=["harmonic", "hertz"], help="(harmonic hertz)", metavar="LAW"
    )
    found.add_argument("--n", type=int, nargs="+", default=[64, 256])
    found.add_argument(
        "--overlaps", type=float, nargs=2, default=[1e-5, 3e-2], metavar=("LOW", "HIGH"),
        help="lowest and highest (1e-5 3e-2)",
    )  # fmt: skip
    found.add_argument("--points", type=int, default=10, help="energies (%(default)s)")
    found.add_argument(
        "--fit", type=float, nargs=2, default=[1e-5, 1e-3], metavar=("LOW", "HIGH"),
        help="phi - phi_J of the fits (1e-5 1e-3)",
    )  # fmt: skip
    found.add_argument(
        "--fit-contacts", type=float, nargs=2, default=[2e-3, 5e-2], metavar=("LOW", "HIGH"),
        help="that of z and of the shear modulus, which finite size limits (2e-3 5e-2)",
    )  # fmt: skip
    add_folder(found, samples=40)
    return found


def main(options: Namespace) -> None:
    """Make, average, fit, draw, report."""
    low, high = options.overlaps
    overlaps = tuple(float(f"{x:.4g}") for x in np.geomspace(low, high, options.points))
    every = {
        (law, n): [Series(law, n, seed, overlaps) for seed in range(1, options.samples + 1)]
        for law in options.laws
        for n in options.n
    }
    if not options.only_kept:
        found_of(
            options.runs, [one for of in every.values() for one in of], options.jobs, COMPRESSED
        )
    span, of_contacts = tuple(options.fit), tuple(options.fit_contacts)
    spans = dict.fromkeys(LABELS, span) | dict.fromkeys(("excess", "shear"), of_contacts)
    found = [
        scaling_of(law, n, Table(np.array(overlaps), rows_of(options.runs, of)), spans)
        for (law, n), of in every.items()
    ]
    save_figure(figure_from(found), options.out)
    systems = [summary(of) for of in found]
    write_table(options, systems)
    report({"out": options.out, "systems": systems})


if __name__ == "__main__":
    run(parser(), main)
