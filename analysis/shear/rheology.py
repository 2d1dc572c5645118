"""Draw what steady shear does against packing fraction: stress, contacts, order, rotation.

    python analysis/shear/rheology.py runs/shear/*.h5 --out rheology.png

Runs of `jamshape shear`, of several packing fractions, rates and kinds of particles: p over the rate, sigma over the rate,
mu, z, S_2 and the mean rotation, as Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002 (2019) and
Marschall & Teitel, Phys. Rev. E 100, 032906 (2019). Averages leave the start-up out, which `--after` sets for all. The last
line of standard output is one JSON object with all averages and their errors.
"""

from __future__ import annotations

from argparse import Namespace

from jamshape.command import parser_of, report, run
from jamshape.drawing.rheology import rheology_figure
from jamshape.drawing.saving import save_figure
from jamshape.measures.shears import read_shear


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    runs = [read_shear(path, options.after) for path in options.files]
    steady = [one for one in runs if one.steady]
    if not steady:
        raise ValueError(runs[0].problem)
    save_figure(rheology_figure(steady), options.out)
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
