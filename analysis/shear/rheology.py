"""Draw what steady shear does against packing fraction: stress, contacts, order, rotation.

    python analysis/shear/rheology.py runs/shear/*.h5 --out rheology.png

Runs of `jamshape shear`, of several packing fractions, rates and kinds of particles: p over the rate, sigma over the rate,
mu, z, S_2 and the mean rotation, as Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002 (2019) and
Marschall & Teitel, Phys. Rev. E 100, 032906 (2019). Averages leave the start-up out, which `--after` sets for all. Prints a
table (Markdown); memory is the strain over which the packing's pressure remembers. The last line of standard output is one JSON object with all averages and their errors.
"""

from __future__ import annotations

import math
from argparse import Namespace

from jamshape.command import parser_of, report, run
from jamshape.drawing.rheology import rheology_figure
from jamshape.drawing.saving import save_figure
from jamshape.measures.shears import ShearOf, read_shear
from jamshape.measures.steady import SteadyMean

# Numbers below this power of ten are written with it.
_SMALLEST = -2


COLUMNS = {
    "pressure": "p",
    "sigma": "sigma",
    "mu": "mu",
    "z": "z",
    "S_2": "S_2",
    "rotation": "rotation",
}


def table(runs: list[ShearOf]) -> str:
    """Write the averages as Markdown, a row for each run."""
    heads = ("alpha", "gdot", "phi", "strain", "start-up", *COLUMNS.values(), "memory")
    lines = [heads, ("---",) * len(heads)]
    for one in runs:
        of, steady = one.ensemble, one.steady
        assert steady
        alpha = f"{of.system.number('alpha'):g}"
        means = [_text(steady.averages.get(name)) for name in COLUMNS]
        known = (
            alpha,
            f"{of.gdot:g}",
            f"{of.phi:.4g}",
            f"{steady.strain:.3g}",
            f"{steady.startup:.2g}",
        )
        lines.append((*known, *means, f"{steady['pressure'].memory:.2g}"))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _text(one: SteadyMean | None) -> str:
    """Write an average with its error in two digits of the error."""
    if one is None:
        return ""
    if not one.error > 0:
        return f"{one.value:.3g}"
    digits = max(0, 1 - math.floor(math.log10(abs(one.error))))
    power = math.floor(math.log10(abs(one.value))) if one.value else 0
    if power < _SMALLEST:
        scale = 10.0**-power
        return f"({one.value * scale:.{max(0, digits + power)}f} +- {one.error * scale:.{max(0, digits + power)}f})e{power}"
    return f"{one.value:.{digits}f} +- {one.error:.{digits}f}"


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    runs = [read_shear(path, options.after) for path in options.files]
    steady = [one for one in runs if one.steady]
    if not steady:
        raise ValueError(runs[0].problem)
    save_figure(rheology_figure(steady), options.out)
    ordered = sorted(
        steady, key=lambda one: (one.ensemble.system, one.ensemble.gdot, one.ensemble.phi)
    )
    print(table(ordered))
    rows = [
        one.ensemble.report() | {"seed": one.seed, "strain": one.strain[-1]} | one.steady.report()
        for one in steady
        if one.steady
    ]
    report(
        {"out": options.out, "runs": rows, "short": [one.problem for one in runs if one.problem]}
    )


if __name__ == "__main__":
    parser = parser_of(__doc__, "rheology.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
