"""Draw nematic and cubatic order of packings: Fig. 4 a of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_global_order.py SWEEP [MORE ...] --out global_order.png

Left S_2 against C_4, right S_2 against the reduced aspect ratio beta. Large marks are averages over samples with
their standard errors, small ones single packings; open of protocol 1, filled of protocol 2. Lines are at 1/sqrt(N),
and the cross where as many particles of random directions are (average of 200 draws). The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
from superellipsoid_files import (
    OF_PAPER,
    Groups,
    averages,
    beta_axis,
    exactly,
    family_legend,
    mark,
    parser_of,
    points,
    read_groups,
    rows,
    samples_text,
)
from sweep_files import BLACK, mean

from jamshape.measures.order3d import cubatic_order, nematic_order
from jamshape.packing import body_axes

DRAWS = 200


def random_order(n: int) -> dict[str, float]:
    """Average S_2 and C_4 over draws of n random orientations."""
    rng = np.random.default_rng(1)
    draws = [body_axes(rng.normal(size=(n, 4))) for _ in range(DRAWS)]
    nematic = mean([nematic_order(axes[:, 0]).magnitude for axes in draws]).value
    return {"S2": nematic, "C4": mean([cubatic_order(axes).magnitude for axes in draws]).value}


def draw(groups: Groups, at_random: dict[str, float], out: Path) -> None:
    """Draw S_2 against C_4 and beta."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(10.5, 4.2), dpi=200, layout="constrained")
    both, flat = figure.subplots(1, 2, sharey=True)
    S2, C4, n = averages(groups, "S2"), averages(groups, "C4"), _n(groups)
    for kind, samples in groups.items():
        single: dict[str, Any] = mark(kind) | {"ls": "none", "ms": 2.5, "alpha": 0.5}
        single["mfc"] = single["color"]
        values = [s.number("S2") for s in samples]
        both.plot([s.number("C4") for s in samples], values, **single)
        flat.plot([kind.beta] * len(samples), values, **single)
    points(both, C4, S2)
    points(flat, exactly(groups, lambda kind: kind.beta), S2)
    both.plot(at_random["C4"], at_random["S2"], "+", color=BLACK, ms=10, label="random directions")
    for axes in (both, flat):
        axes.axhline(1 / math.sqrt(n), **OF_PAPER, label=r"$1/\sqrt{N}$")
        axes.set(xscale="log", yscale="log")
    both.axvline(1 / math.sqrt(n), **OF_PAPER)
    both.set(xlabel="cubatic order $C_4$", ylabel="nematic order $S_2$")
    flat.axvline(1, color="0.8", lw=0.8, ls=":", zorder=0)
    beta_axis(flat.xaxis)
    family_legend(flat, groups, samples_text(groups), loc="outside right center")
    both.legend(fontsize=8, loc="best")
    figure.savefig(out)


def _n(groups: Groups) -> int:
    return int(next(iter(groups.values()))[0].number("n"))


def main() -> None:
    """Read, average, draw, report."""
    options = parser_of(__doc__, "global_order.png").parse_args()
    groups = read_groups(options.packings)
    at_random = random_order(_n(groups))
    draw(groups, at_random, options.out)
    found = rows(groups, {name: averages(groups, name) for name in ("S2", "C4")})
    extra = {"random": at_random, "one_over_sqrt_n": 1 / math.sqrt(_n(groups))}
    print(json.dumps({"out": str(options.out), "order": found} | extra))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_global_order.py: {error}")
