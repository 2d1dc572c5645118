"""Draw contact numbers against aspect ratio: Fig. 8 of Marschall & Teitel, PRE 97, 012905.

    python analysis/fig_contact_number.py SWEEP [MORE.h5 ...] --out contact_number.png

z counts a side-to-side contact as two bonds, z_single as one; neither counts rattlers. On the right
is how z - 4 goes to its limit at alpha = 0, with a fit of a + b alpha^x to the four smallest alpha
above 0 if they are small enough. The last line of standard output is one JSON object with the
averages over samples and the fits.
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
    SKY,
    Mean,
    Sweep,
    discs_at,
    error_bars,
    label_alpha_axis,
    mean,
    plain,
    read_sweep,
    samples_text,
)

from jamshape.measures.contact_statistics import OffsetPowerLaw, fit_offset_power_law

Z_OF_DISCS, ISOSTATIC = 4.0, 6.0
# Sec. III C, Fig. 8: z at N = 1024, and the a of a + b alpha^x with its error.
PAPER = {
    0.0: Mean(4.0, math.nan, 0),
    0.01: Mean(4.43, 0.03, 0),
    1.0: Mean(5.91, 0.01, 0),
    4.0: Mean(5.64, 0.01, 0),
}
PAPER_LIMIT, PAPER_LIMIT_ERROR = 0.31, 0.08
PAPER_FITS = {
    "z": {"a": 0.31, "a_error": 0.08, "x": 0.68, "x_error": 0.13},
    "z_single": {"a": -0.048, "a_error": 0.065, "x": 0.67, "x_error": 0.11},
}
PAPER_RATTLERS = {0.01: 34.0, 1.0: 0.0, 4.0: 1.2}

FITTED = 4  # of the smallest alpha, as in the paper
STYLES = {
    "z": ("o", BLUE, r"\langle z_J\rangle"),
    "z_single": ("D", RED, r"\langle\tilde z_J\rangle"),
}

Averages = dict[float, Mean]


def averages(sweep: Sweep, name: str) -> Averages:
    """Average one attribute over the samples of each alpha."""
    return {alpha: mean([s.number(name) for s in samples]) for alpha, samples in sweep.items()}


def smallest(known: Averages, largest: float) -> list[float]:
    """Select the alpha that are fitted."""
    return [alpha for alpha in known if 0 < alpha <= largest][:FITTED]


def fit(known: Averages, largest: float) -> tuple[OffsetPowerLaw | None, str]:
    """Fit z - 4 at the smallest alpha above 0, or say why not."""
    small = smallest(known, largest)
    if len(small) < FITTED:
        return None, f"{len(small)} alpha from 0 to {largest:g}, expected {FITTED} for a fit"
    means = [known[alpha] for alpha in small]
    errors = np.array([m.error for m in means])
    above = np.array([m.value for m in means]) - Z_OF_DISCS
    try:
        return fit_offset_power_law(small, above, errors if (errors > 0).all() else None), ""
    except ValueError as error:
        return None, str(error)


def above_discs(known: Averages) -> Averages:
    """Subtract the contact number of discs; what is not above it is left out."""
    above = {alpha: m._replace(value=m.value - Z_OF_DISCS) for alpha, m in known.items()}
    return {alpha: m for alpha, m in above.items() if m.value > 0}


def draw(
    known: dict[str, Averages],
    curves: dict[str, tuple[OffsetPowerLaw, list[float]]],
    samples: str,
    out: Path,
) -> None:
    """Draw z on the left, z - 4 on logarithmic axes with fits to some alpha on the right."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(9, 4), dpi=200, layout="constrained")
    linear, logarithmic = figure.subplots(1, 2)
    discs = discs_at([*known["z"], *PAPER])
    for name, (marker, color, symbol) in STYLES.items():
        style: dict[str, Any] = {"fmt": marker, "color": color, "mfc": "none"}
        error_bars(linear, known[name], discs, **style, label=f"${symbol}$")
        error_bars(logarithmic, above_discs(known[name]), None, **style, label=f"${symbol} - 4$")
    for name, (law, alphas) in curves.items():
        alpha = np.geomspace(alphas[0] / 2, alphas[-1] * 2, 100)
        alpha = alpha[law.at(alpha) > 0]
        text = rf"${law.a:.2f} {law.b:+.2f}\,\alpha^{{{law.x:.2f}}}$"
        logarithmic.plot(alpha, law.at(alpha), color=STYLES[name][1], lw=1, label=text)
    error_bars(linear, PAPER, discs, **PAPER_STYLE)
    error_bars(logarithmic, above_discs(PAPER), None, **PAPER_STYLE)
    linear.axhline(ISOSTATIC, color="0.5", ls="--", lw=1, zorder=0)
    note: dict[str, Any] = {"fontsize": 8, "color": "0.3", "va": "bottom"}
    note |= {"ha": "right", "transform": linear.get_yaxis_transform()}
    linear.text(0.98, ISOSTATIC, "isostatic", **note)
    linear.set_ylim(top=max(ISOSTATIC + 0.25, linear.get_ylim()[1]))
    linear.set_ylabel("contacts per particle at jamming")
    label_alpha_axis(linear, discs)
    upper_left: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (0, 0.92)}
    linear.legend(title=samples, title_fontsize=8, fontsize=8, **upper_left)
    low, high = PAPER_LIMIT - PAPER_LIMIT_ERROR, PAPER_LIMIT + PAPER_LIMIT_ERROR
    limit = r"$\langle z_J\rangle - 4$ at $\alpha\to 0$, paper"
    logarithmic.axhspan(low, high, color=SKY, alpha=0.3, lw=0, label=limit, zorder=0)
    logarithmic.set_yscale("log", nonpositive="clip")
    logarithmic.set_ylabel("contacts per particle above 4")
    label_alpha_axis(logarithmic, None)
    logarithmic.legend(fontsize=8, loc="lower right")
    figure.savefig(out)


def main() -> None:
    """Read, average, fit, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("packings", type=Path, nargs="+", metavar="SWEEP", help="folder or files")
    parser.add_argument(
        "--out", type=Path, default=Path("contact_number.png"), help="(%(default)s)"
    )
    largest = "largest alpha of the fit (%(default)s)"
    parser.add_argument("--largest", type=float, default=0.25, help=largest)
    options = parser.parse_args()
    sweep = read_sweep(options.packings)
    known = {name: averages(sweep, name) for name in STYLES}
    rattlers = averages(sweep, "n_rattlers")
    fits = {name: fit(values, options.largest) for name, values in known.items()}
    curves = {
        name: (law, smallest(known[name], options.largest))
        for name, (law, _) in fits.items()
        if law
    }
    draw(known, curves, samples_text(sweep), options.out)
    rows = [
        {"alpha": alpha, "paper_z": PAPER[alpha].value if alpha in PAPER else None}
        | {"paper_rattlers": PAPER_RATTLERS.get(alpha)}
        | {name: values[alpha].report() for name, values in known.items()}
        | {"rattlers": rattlers[alpha].report()}
        for alpha in sweep
    ]
    laws: dict[str, Any] = {}
    for name, (law, why) in fits.items():
        numbers = {key: plain(value) for key, value in law._asdict().items()} if law else None
        laws[name] = {"fit": numbers, "why_not": why or None, "paper": PAPER_FITS[name]}
    print(json.dumps({"out": str(options.out), "contact_numbers": rows, "fits": laws}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_contact_number.py: {error}")
