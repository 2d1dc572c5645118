"""Draw global against local order: Fig. 13 of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_local_order.py SWEEP [MORE ...] --out local_order.png

S_2 and C_4 of whole packings against the averages over their particles of those of the particles in contact
(Appendix B). Crosses are what as many random directions have, by the number of contacts: few neighbours seem
ordered. The last line of standard output is one JSON object with averages over samples and their errors.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
from superellipsoid_files import (
    LOCAL_ORDER,
    Averages,
    Groups,
    averages,
    family_legend,
    local_order,
    packing_of,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import BLACK, Mean, mean

from jamshape.contacts import find_contacts
from jamshape.measures.order3d import local_cubatic_order, local_nematic_order
from jamshape.packing import body_axes

GLOBAL = {"S2": "nematic order $S_2$", "C4": "cubatic order $C_4$"}


def measure(groups: Groups) -> tuple[dict[str, Averages], dict[str, Averages]]:
    """Average local order over particles and samples, and that of the same contacts at random."""
    found: dict[str, Averages] = {name: {} for name in LOCAL_ORDER}
    at_random: dict[str, Averages] = {name: {} for name in LOCAL_ORDER}
    rng = np.random.default_rng(1)
    for kind, samples in groups.items():
        packings = [packing_of(sample) for sample in samples]
        own = [local_order(packing) for packing in packings]
        packing = packings[0]
        axes, pairs = body_axes(rng.normal(size=(packing.n, 4))), find_contacts(packing).pairs
        lost = {
            "S2": local_nematic_order(axes[:, 0], pairs),
            "C4": local_cubatic_order(axes, pairs),
        }
        for name in LOCAL_ORDER:
            found[name][kind] = mean([_average(values[name]) for values in own])
            at_random[name][kind] = Mean(_average(lost[name]), np.nan, 1)
    return found, at_random


def _average(values: np.ndarray) -> float:
    return mean(values).value


def draw(
    groups: Groups, local: dict[str, Averages], at_random: dict[str, Averages], out: Path
) -> None:
    """Draw both kinds of order."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(10.5, 4.2), dpi=200, layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, name in zip(panels, GLOBAL, strict=True):
        known = averages(groups, name)
        level = float(np.median([m.value for m in known.values()]))
        x = [m.value for m in at_random[name].values()]
        low = np.full(len(x), min(level, *(m.value for m in known.values())))
        axes.plot(x, low, "+", color=BLACK, ms=6, alpha=0.6, label="local, random directions")
        points(axes, local[name], known)
        axes.set(xlabel=LOCAL_ORDER[name], ylabel=GLOBAL[name])
    family_legend(panels[0], groups, samples_text(groups), loc="outside right center")
    figure.savefig(out)


def main() -> None:
    """Read, measure, draw, report."""
    options = parser_of(__doc__, "local_order.png").parse_args()
    groups = read_groups(options.packings)
    local, at_random = measure(groups)
    draw(groups, local, at_random, options.out)
    columns = {name: averages(groups, name) for name in GLOBAL}
    columns |= {f"local_{name}": values for name, values in local.items()}
    columns |= {f"random_{name}": values for name, values in at_random.items()}
    print(json.dumps({"out": str(options.out), "order": rows(groups, columns)}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_local_order.py: {error}")
