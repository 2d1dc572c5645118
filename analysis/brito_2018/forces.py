"""Draw distributions of contact forces of round and of nearly round particles.

    python analysis/brito_2018/forces.py SWEEP [MORE ...] --out forces.png

The density of small forces f, over their mean, is taken as f^theta. theta is the maximum likelihood of the forces below
--below, with its error: 1 + theta = 1 / <ln(below / f)>. Of a smooth distribution with a finite P(0) it goes to 0 with the bound,
in proportion to it; JSON has it for several bounds, and extrapolated from each and half of it to 0. There is a power law if
theta extrapolated from --below is above 0 by two errors. Brito, Ikeda, Urbani, Wyart & Zamponi, PNAS 115, 11736 (2018), state
that forces of hypostatic packings follow no power law, so that P(0) is finite and theta 0, unlike those of isostatic
packings of round particles. Bonds of rattlers and grazing bonds, below 1e-6 of the mean,
are left out. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, run
from jamshape.contacts import Contacts
from jamshape.files.ensembles import PackingFile

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.bearing import bearing_bonds
from common.small_values import Quantity, add_options, study

FORCES = Quantity(
    name="forces",
    label=r"force over its mean, $f/\langle f\rangle$",
    symbol=r"\theta",
    power="theta",
    sign=1,
    bounds=(0.4, 0.2, 0.1, 0.05, 0.025),
)


def forces_of(file: PackingFile) -> FloatArray:
    """Return the (B,) magnitudes of the bond forces of a packing over their mean."""
    found = Contacts.of(file.packing())
    size = np.linalg.norm(found.network.bonds.force[bearing_bonds(found)], axis=1)
    return np.asarray(size / size.mean())


if __name__ == "__main__":
    parser = parser_of(__doc__, "forces.png", "SWEEP")
    add_options(parser, below=0.1)
    run(parser, lambda options: study(options, FORCES, forces_of))
