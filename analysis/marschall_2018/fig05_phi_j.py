"""Draw the jamming density against aspect ratio: Fig. 5 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_phi_j.py SWEEP [MORE.h5 ...] --out phi_j.png

phi_J is known in three ways: of each packing, led from its energy density u0 to zero; and of the run
at finite rate before it, where there is one, led from its pressure to zero as in the paper, once as the box
closes and once as it opens again. Those two tell what the rate does: they rise as kappa falls. The last
line of standard output is one JSON object with the averages over samples.
"""

from __future__ import annotations

import json
import math
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np
from sweep_files import (
    BLUE,
    PAPER_STYLE,
    RED,
    Mean,
    Sweep,
    discs_at,
    error_bars,
    label_alpha_axis,
    mean,
    read_sweep,
    samples_text,
)

# Secs. III A, B; the error is that of the average, where it is given.
PAPER = {
    0.0: Mean(0.8412, 0.0005, 0),
    1.0: Mean(0.8875, math.nan, 0),
    4.0: Mean(0.866, math.nan, 0),
}
NAMES = ("phi_J", "phi_J_compression", "phi_J_opening")

Averages = dict[str, dict[float, Mean]]


def averages(sweep: Sweep) -> Averages:
    """Average over the samples of each alpha, those left out that do not know."""
    return {
        name: {
            alpha: mean([s.number(name) for s in samples if name in s.attributes])
            for alpha, samples in sweep.items()
        }
        for name in NAMES
    }


def draw(known: Averages, samples: str, out: Path) -> None:
    """Draw phi_J against alpha, discs at the left end."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(5.6, 4), dpi=200, layout="constrained")
    axes = figure.subplots()
    alphas = list(known["phi_J"])
    discs = discs_at([*alphas, *PAPER])
    styles: tuple[dict[str, Any], ...] = (
        {"fmt": "o-", "color": BLUE, "label": f"$\\phi_J$ from $u_0$ to 0 ({samples})"},
        {"fmt": "s", "color": RED, "mfc": "none", "label": r"$\phi_J$ from $p$ to 0, compression"},
        {
            "fmt": "^",
            "color": RED,
            "mfc": "none",
            "label": r"$\phi_J$ from $p$ to 0, opening again",
        },
    )
    for name, style in zip(NAMES, styles, strict=True):
        found = {alpha: m for alpha, m in known[name].items() if m.samples}
        if found:
            error_bars(axes, found, discs, **style)
    error_bars(axes, PAPER, discs, **PAPER_STYLE)
    label_alpha_axis(axes, discs)
    axes.set_ylabel(r"jamming density $\langle\phi_J\rangle$")
    axes.legend(fontsize=8, frameon=False)
    figure.savefig(out)


def main() -> None:
    """Read, average, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    parser.add_argument("--out", type=Path, default=Path("phi_j.png"), help="(phi_j.png)")
    options = parser.parse_args()
    sweep = read_sweep(options.packings)
    known = averages(sweep)
    if not np.isfinite([m.value for m in known["phi_J"].values()]).all():
        msg = (
            f"{options.packings[0]}: phi_J is not known at some alpha, expected it of each packing"
        )
        raise ValueError(msg)
    draw(known, samples_text(sweep), options.out)
    report = [
        {"alpha": alpha, "paper": PAPER[alpha].value if alpha in PAPER else None}
        | {n: known[n][alpha].report() for n in NAMES}
        for alpha in sweep
    ]
    print(json.dumps({"out": str(options.out), "phi_J": report}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_phi_j.py: {error}")
