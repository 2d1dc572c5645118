"""Draw contact numbers against aspect ratio: Fig. 8 of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/fig08_contact_number.py SWEEP [MORE.h5 ...] --out contact_number.png

z counts a side-to-side contact as two bonds, z_single as one; z_bearing counts bonds with at least 1e-6 of the mean
force; none counts rattlers. The right panel shows how z approaches its limit at alpha = 0, 4 for discs and 6 for spheres, with
a fit of a + b alpha^x to the excess at the four smallest alpha above 0 if they are small enough. Any shapes with an
aspect ratio alpha may be given, each is a curve. The last line of standard output is one JSON object with the averages over samples and the fits.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import SKY
from jamshape.files.ensembles import PackingFile, System
from jamshape.measures.averages import Mean

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import averages
from common.axes import SMALL_TEXT, discs_at, error_bars, figure_of, label_alpha_axis
from common.ensembles import conditions, curves_over, of_paper, read_groups
from common.offset_power_law import OffsetPowerLaw, fit_offset_power_law
from common.published import RATTLERS, Z
from common.styles import PAPER_STYLE, color
from common.text import conditions_text, system_labels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

# Sec. III C, Fig. 8, N = 1024: the a of a + b alpha^x with its error.
PAPER_LIMIT, PAPER_LIMIT_ERROR = 0.31, 0.08
PAPER_FITS = {
    "z": {"a": 0.31, "a_error": 0.08, "x": 0.68, "x_error": 0.13},
    "z_single": {"a": -0.048, "a_error": 0.065, "x": 0.67, "x_error": 0.11},
}

FITTED = 4  # of the smallest alpha, as in the paper
MARKS = {
    "z": ("o", r"\langle z_J\rangle"),
    "z_single": ("D", r"\langle\tilde z_J\rangle"),
    "z_bearing": ("s", r"\langle z_J\rangle"),
}

SIDES = {
    "z": "side-to-side as two",
    "z_single": "side-to-side as one",
    "z_bearing": "as two, bonds above 1e-6 of the mean force",
}

Averages = dict[float, Mean]


class Fitted(NamedTuple):
    """A fit to z above that of round particles, at these alpha, or why there is none."""

    law: OffsetPowerLaw | None
    alphas: list[float]
    why_not: str = ""


class Found(NamedTuple):
    """What is known of one curve."""

    z: dict[str, Averages]
    fits: dict[str, Fitted]
    rattlers: Averages


def round_z(system: System) -> int:
    """Isostatic contact number of discs or spheres."""
    return 2 * system.dimension


def fit(known: Averages, limit: int, largest: float) -> Fitted:
    """Fit what z is above its limit at the smallest alpha above 0, or say why not."""
    small = [alpha for alpha in known if 0 < alpha <= largest][:FITTED]
    if len(small) < FITTED:
        found = f"{len(small)} alpha from 0 to {largest:g}"
        return Fitted(None, small, f"{found}, expected {FITTED} for a fit")
    means = [known[alpha] for alpha in small]
    above = np.array([m.value for m in means]) - limit
    try:
        law = fit_offset_power_law(small, above, errors_of(means))
    except ValueError as error:
        return Fitted(None, small, str(error))
    return Fitted(law, small)


def errors_of(means: list[Mean]) -> FloatArray | None:
    """Errors of averages; that of a single sample is the usual deviation of samples of the others. None if nobody knows."""
    errors, samples = np.array([m.error for m in means]), np.array([m.samples for m in means])
    is_known = np.isfinite(errors)
    if not is_known.any():
        return None
    usual = np.median((errors * np.sqrt(samples))[is_known])
    errors = np.where(is_known, errors, usual)
    return errors if (errors > 0).all() else None


def above(known: Averages, limit: int) -> Averages:
    """Subtract the contact number of round particles; what is not above it is left out."""
    left = {alpha: m._replace(value=m.value - limit) for alpha, m in known.items()}
    return {alpha: m for alpha, m in left.items() if m.value > 0}


def draw(curves: dict[System, Found], title: str, options: Namespace) -> None:
    """Draw z on the left, what it is above its limit on logarithmic axes on the right."""
    figure = figure_of(10.5, 4.4)
    linear, logarithmic = figure.subplots(1, 2)
    discs = discs_at([*Z, *(alpha for found in curves.values() for alpha in found.z["z"])])
    labels = system_labels(curves)
    for k, (system, found) in enumerate(curves.items()):
        limit = round_z(system)
        for way, name in enumerate(found.z):
            marker, symbol = MARKS[name]
            tint, text = color(len(MARKS) * k + way), f", {labels[system]}" * (labels[system] != "")
            style: dict[str, Any] = {"fmt": marker, "color": tint, "mfc": "none"}
            label = f"${symbol}$, {SIDES[name]}{text}"
            error_bars(linear, found.z[name], discs, **style, label=label)
            error_bars(logarithmic, above(found.z[name], limit), None, **style)
            draw_fit(logarithmic, found.fits[name], tint)
    if any(of_paper(system) for system in curves):
        draw_paper(linear, logarithmic, discs)
    finish(linear, [2 * limit_of_turning(system) for system in curves])
    logarithmic.set_yscale("log", nonpositive="clip")
    limits = " or ".join(map(str, sorted({round_z(system) for system in curves})))
    logarithmic.set_ylabel(f"contacts above the {limits} of round particles")
    figure.suptitle(title, fontsize=8)
    figure.legend(loc="outside right center", **SMALL_TEXT)
    label_alpha_axis(linear, discs)
    label_alpha_axis(logarithmic, None)
    save_figure(figure, options.out)


def limit_of_turning(system: System) -> int:
    """Degrees of freedom of particles with one axis of symmetry."""
    return {2: 3, 3: 5}[system.dimension]


def draw_fit(axes: Axes, fitted: Fitted, tint: str) -> None:
    """Draw a law beyond the alpha that it was fitted to."""
    law = fitted.law
    if law:
        alpha = np.geomspace(fitted.alphas[0] / 2, fitted.alphas[-1] * 2, 100)
        alpha = alpha[law.at(alpha) > 0]
        text = rf"fit, ${law.a:.2f} {law.b:+.2f}\,\alpha^{{{law.x:.2f}}}$"
        axes.plot(alpha, law.at(alpha), color=tint, lw=1, label=text)


def draw_paper(linear: Axes, logarithmic: Axes, discs: float) -> None:
    """Draw the numbers of the paper."""
    error_bars(linear, Z, discs, **PAPER_STYLE)
    error_bars(logarithmic, above(Z, 4), None, **PAPER_STYLE | {"label": ""})
    low, high = PAPER_LIMIT - PAPER_LIMIT_ERROR, PAPER_LIMIT + PAPER_LIMIT_ERROR
    limit = r"$\langle z_J\rangle - 4$ at $\alpha\to 0$, paper"
    logarithmic.axhspan(low, high, color=SKY, alpha=0.3, lw=0, label=limit, zorder=0)


def finish(axes: Axes, isostatic: list[int]) -> None:
    """Mark isostatic contact numbers."""
    note: dict[str, Any] = {"fontsize": 8, "color": "0.3", "va": "bottom"}
    note |= {"ha": "right", "transform": axes.get_yaxis_transform()}
    for level in sorted(set(isostatic)):
        axes.axhline(level, color="0.5", ls="--", lw=1, zorder=0)
        axes.text(0.98, level, "isostatic: twice the degrees of freedom", **note)
    axes.set_ylim(top=max(max(isostatic) + 0.25, axes.get_ylim()[1]))
    axes.set_ylabel("contacts per particle at jamming")


def rows(system: System, found: Found) -> list[dict[str, Any]]:
    """Report one curve."""
    paper, rattlers = (Z, RATTLERS) if of_paper(system) else ({}, {})
    return [
        system.report()
        | {"alpha": alpha, "paper_z": paper[alpha].value if alpha in paper else None}
        | {"paper_rattlers": rattlers.get(alpha)}
        | {name: values.get(alpha) for name, values in found.z.items()}
        | {"rattlers": found.rattlers[alpha]}
        for alpha in found.z["z"]
    ]


def having(name: str, curve: Mapping[float, list[PackingFile]]) -> dict[float, list[PackingFile]]:
    """Select the alphas of which all samples have a number, as files of earlier versions do not have all."""
    return {
        alpha: files for alpha, files in curve.items() if all(name in f.attributes for f in files)
    }


def fits_of(system: System, found: Found) -> dict[str, Any]:
    """Report the fits of one curve."""
    paper = PAPER_FITS if of_paper(system) else {}
    return system.report() | {
        name: {"fit": fitted.law, "why_not": fitted.why_not or None, "paper": paper.get(name)}
        for name, fitted in found.fits.items()
    }


def main(options: Namespace) -> None:
    """Read, average, fit, draw, report."""
    groups = read_groups(options.files, needs=["alpha"], same=("n", "size_ratio", "u0"))
    curves = {}
    for system, curve in curves_over(groups, "alpha").items():
        z = {name: averages(curve, name) for name in ("z", "z_single")}
        if known := having("z_bearing", curve):
            z["z_bearing"] = averages(known, "z_bearing")
        fits = {name: fit(of, round_z(system), options.largest) for name, of in z.items()}
        curves[system] = Found(z, fits, averages(curve, "n_rattlers"))
    draw(curves, conditions_text(groups), options)
    found = [row for system, of in curves.items() for row in rows(system, of)]
    laws = [fits_of(system, of) for system, of in curves.items()]
    told = {"out": options.out, "conditions": conditions(groups)}
    report(told | {"contact_numbers": found, "fits": laws})


if __name__ == "__main__":
    parser = parser_of(__doc__, "contact_number.png", "SWEEP")
    largest = "largest alpha of the fit (%(default)s)"
    parser.add_argument("--largest", type=float, default=0.25, help=largest)
    run(parser, main)
