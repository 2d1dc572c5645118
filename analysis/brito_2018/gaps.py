"""Draw distributions of gaps between round and nearly round particles that do not touch.

    python analysis/brito_2018/gaps.py SWEEP [MORE ...] --out gaps.png

The gap h of two particles is the swelling at which they touch: of all particles about their centres, by the factor 1 + h. It is
r / (R_i + R_j) - 1 of discs. Gaps are found as contacts that appear when the particles of a packing swell in small steps, of
10 % of h. The density of small gaps is taken as h^-gamma, with gamma from those below --below as in forces.py; JSON has it for
several bounds, and extrapolated, which tells whether there is a power law. Brito, Ikeda, Urbani, Wyart & Zamponi, PNAS 115, 11736 (2018), state that gaps of hypostatic packings follow no
power law, unlike those of isostatic packings of round particles. Rattlers are left out. The last line of standard output is
one JSON object.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from jamshape.arrays import FloatArray, IntArray
from jamshape.command import parser_of, run
from jamshape.contacts import Contacts, find_contacts
from jamshape.files.ensembles import PackingFile

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.small_values import Quantity, add_options, study

GAPS = Quantity(
    name="gaps",
    label=r"gap $h$, swelling at which particles touch",
    symbol=r"\gamma",
    power="gamma",
    sign=-1,
    bounds=(0.1, 0.05, 0.02, 0.01),
)
SWELLINGS = np.geomspace(1e-7, 0.2, 146)
"""From overlaps of packings at u0 = 1e-15, far below the smallest bound."""


def rising(count_at: Callable[[int], int], n: int) -> IntArray:
    """Return n >= 2 counts that never fall; between equal ones they are not counted.

    Examples
    --------
    >>> rising(lambda k: int(k > 5), 9)
    array([0, 0, 0, 0, 0, 0, 1, 1, 1])
    """
    counts = np.zeros(n, np.int64)
    counts[0], counts[-1] = count_at(0), count_at(n - 1)
    spans = [(0, n - 1)]
    while spans:
        low, high = spans.pop()
        if counts[low] == counts[high]:
            counts[low:high] = counts[low]
        elif high - low > 1:
            middle = (low + high) // 2
            counts[middle] = count_at(middle)
            spans += [(low, middle), (middle, high)]
    return counts


def gaps_of(file: PackingFile) -> FloatArray:
    """Return the (B,) gaps of a packing below the largest swelling, each at the middle of its step."""
    packing = file.packing()
    rattlers = Contacts.of(packing).rattlers

    def touching_at(k: int) -> int:
        swollen = packing.with_(diameters=(1 + SWELLINGS[k]) * packing.diameters)
        return int(np.count_nonzero(~rattlers[find_contacts(swollen).pairs].any(axis=1)))

    touching = rising(touching_at, len(SWELLINGS))
    middles = np.sqrt(SWELLINGS[1:] * SWELLINGS[:-1])
    return np.repeat(middles, np.diff(touching))


if __name__ == "__main__":
    parser = parser_of(__doc__, "gaps.png", "SWEEP")
    add_options(parser, below=0.02)
    run(parser, lambda options: study(options, GAPS, gaps_of))
