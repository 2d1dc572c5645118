"""Draw classes of contact against aspect ratio: Fig. 9 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_contact_classes.py SWEEP [MORE.h5 ...] --out contact_classes.png

On the left the fractions of the bonds that are side-to-side (two bonds a contact), tip-to-side and
tip-to-tip; on the right the fraction of the particles that have a contact on a flat side, beside
what these sides are of the perimeter. Rattlers are left out. The last line of standard output is one
JSON object with the averages over samples.
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
    GREEN,
    ORANGE,
    PAPER_STYLE,
    RED,
    Mean,
    Sample,
    Sweep,
    discs_at,
    error_bars,
    label_alpha_axis,
    mean,
    read_sweep,
    samples_text,
)

from jamshape.measures.contact_statistics import (
    ClassFractions,
    FlatFraction,
    class_fractions,
    flat_fraction,
)

PAPER_FLAT = {0.01: Mean(0.963, math.nan, 0)}  # Sec. III C
STYLES = {
    "side_to_side": ("s", BLUE, "side-to-side, as two"),
    "tip_to_side": ("o", RED, "tip-to-side"),
    "tip_to_tip": ("D", GREEN, "tip-to-tip"),
}

Averages = dict[float, dict[str, Mean]]


def statistics(sample: Sample) -> dict[str, float]:
    """Count classes and flat contacts of one packing."""
    _, network, rattlers = sample.contacts()
    fractions, flat = class_fractions(network, rattlers), flat_fraction(network, rattlers)
    return fractions._asdict() | {f"flat_{name}": value for name, value in flat._asdict().items()}


def averages(sweep: Sweep) -> Averages:
    """Average over the samples of each alpha."""
    names = (*ClassFractions._fields, *(f"flat_{name}" for name in FlatFraction._fields))
    known: Averages = {}
    for alpha, samples in sweep.items():
        found = [statistics(sample) for sample in samples]
        known[alpha] = {name: mean([numbers[name] for numbers in found]) for name in names}
    return known


def perimeter_share(alpha: Any) -> Any:
    """Flat sides over perimeter, 4A / (4A + 2 pi R)."""
    return 2 * alpha / (2 * alpha + np.pi)


def draw(known: Averages, samples: str, out: Path) -> None:
    """Draw classes on the left and flat contacts on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9, 3.9), dpi=200, layout="constrained")
    classes, flat = figure.subplots(1, 2, sharex=True)
    discs = discs_at([*known, *PAPER_FLAT])
    for name, (marker, color, text) in STYLES.items():
        means = {alpha: row[name] for alpha, row in known.items()}
        error_bars(classes, means, discs, fmt=f"{marker}-", color=color, mfc="none", label=text)
    classes.set_ylabel("fraction of contact bonds")
    classes.legend(title=samples, title_fontsize=8, fontsize=8)
    texts = {
        "flat_of_backbone": ("s", BLUE, "of those that are no rattlers"),
        "flat_of_all": ("o", RED, "of all particles"),
    }
    for name, (marker, color, text) in texts.items():
        means = {alpha: row[name] for alpha, row in known.items()}
        error_bars(flat, means, discs, fmt=marker, color=color, mfc="none", label=text)
    error_bars(flat, PAPER_FLAT, discs, **PAPER_STYLE)
    curve = np.geomspace(2 * discs, max(10.0, *known), 200)
    flat.plot(curve, perimeter_share(curve), "--", color=ORANGE, label="flat part of the perimeter")
    flat.set_ylabel("fraction of particles with a flat contact")
    flat.legend(fontsize=8, loc="upper left", bbox_to_anchor=(0, 0.45))
    for axes in (classes, flat):
        axes.set_ylim(-0.03, 1.03)
        label_alpha_axis(axes, discs)
    figure.savefig(out)


def main() -> None:
    """Read, count, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    out = Path("contact_classes.png")
    parser.add_argument("--out", type=Path, default=out, help="(%(default)s)")
    options = parser.parse_args()
    sweep = read_sweep(options.packings)
    known = averages(sweep)
    draw(known, samples_text(sweep), options.out)
    rows = [
        {"alpha": alpha, "flat_perimeter": perimeter_share(alpha)}
        | {"paper_flat": PAPER_FLAT[alpha].value if alpha in PAPER_FLAT else None}
        | {name: value.report() for name, value in row.items()}
        for alpha, row in known.items()
    ]
    print(json.dumps({"out": str(options.out), "contact_classes": rows}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_contact_classes.py: {error}")
