"""Draw the distribution of contacts over the surface of particles: Fig. 10 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig10_contact_angles.py SWEEP [MORE.h5 ...] --out contact_angles.png

P(phi) is the probability density of a contact at the polar angle phi about the centre from the
spine, small and big particles together, a side-to-side contact counted once, midway. Bins are narrow
where contacts are many; the four quarters of a particle are taken as one. The last line of standard
output is one JSON object with the height of the peak and how much of P is on the flat sides.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.contact_angles import angle_curve, contact_angle_figure
from common.ensembles import Choice, choose, conditions, read_groups
from common.text import conditions_alone, system_labels

PAPER_ALPHAS = (0.01, 0.12, 1.0)
MOST = 5  # curves


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    every = read_groups(options.files, needs=["alpha"], same=("n", "size_ratio", "u0"))
    groups = choose(every, "alpha", Choice(options.alpha, PAPER_ALPHAS, MOST))
    found = {system: angle_curve(system.number("alpha"), of) for system, of in groups.items()}
    labels = system_labels(found)
    curves = {labels[system]: curve for system, curve in found.items()}
    save_figure(contact_angle_figure(curves, conditions_alone(groups)), options.out)
    rows = [
        system.report()
        | {"samples": curve.samples, "contacts": curve.n_contacts}
        | {"peak": curve.density.max(), "on_flat": curve.on_flat}
        | {"peak_degrees": curve.peak_degrees}
        for system, curve in found.items()
    ]
    report({"out": options.out, "conditions": conditions(groups), "contact_angles": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "contact_angles.png", "SWEEP")
    which = "of the curves (0.01, 0.12 and 1 where there are such, as in the paper)"
    parser.add_argument("--alpha", type=float, nargs="+", default=[], help=which)
    run(parser, main)
