"""Draw density, contacts and end contacts of rods in space against aspect ratio.

    python analysis/heussinger_2020/end_contacts.py SWEEP [MORE ...] --out end_contacts.png

Four panels: phi_J with the maximum of others and the random contact law of long rods; z beside 10 and beside 8 + 2 f_0
(Heussinger, arXiv 2004.13460), with f_0 the fraction of rods with contacts at both ends; fractions of the contacts
by ends, and f_0; rattlers. Grazing bonds, below 1e-6 of the mean force, do not count. The random contact law takes rods that touch
for uncorrelated ones that overlap: z is then the number of rods in the volume that a rod excludes (Onsager 1949;
Wouterse, Luding & Philipse 2009). The last line of standard output is one JSON object with averages and their standard errors; peak has the largest phi_J and its alpha, with half the mean distance of the next ones as its error; as_many
counts the packings of --modes with as many zero modes as rods that have contacts at neither end, which slide freely.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.drawing.styles import BLUE, GREEN, ORANGE, RED
from jamshape.files.ensembles import PackingFile
from jamshape.measures.averages import Mean
from jamshape.vibration.table import ModeTable, read_modes

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean_over
from common.axes import SMALL_TEXT, discs_at, error_bars, figure_of, label_alpha_axis
from common.end_contacts import EndContacts, end_contacts, touched_ends
from common.ensembles import Curve, conditions, one_curve, read_groups
from common.styles import PAPER_LINE, PAPER_STYLE
from common.text import conditions_text

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

NAMES = {"phi_J": "phi_J", "z": "z_bearing", "S2": "S2"}
"""Attributes of files by the names of what is drawn; z is without grazing bonds."""
MAXIMUM = {0.45: Mean(0.721, 0.001)}
"""Imaz González & Cinacchi, J. Phys. Chem. B 127, 6814 (2023), abstract: of MRJ packings."""
PUBLISHED = PAPER_STYLE | {"label": "maximum of MRJ packings (2023)"}
THIN = 7.0
"""Smallest aspect ratio at which the random contact law is drawn."""
ISOSTATIC = (0.45, 2.0)
"""Aspect ratios between which those are isostatic, abstract."""
CONTACTS = {
    "side_to_side": ("s-", BLUE, "contacts, side to side"),
    "end_to_side": ("o-", RED, "contacts, end to side"),
    "end_to_end": ("D-", GREEN, "contacts, end to end"),
    "at_both": ("^-", ORANGE, "rods with contacts at both ends, $f_0$"),
}

Averages = dict[str, dict[float, Mean]]


def ends_of(files: Sequence[PackingFile]) -> dict[str, Mean]:
    """Average over samples; z_missing is 8 + 2 f_0 - z without its part of 1 / N."""
    found = [end_contacts(file.contacts()) for file in files]
    columns = {name: [float(getattr(of, name)) for of in found] for name in EndContacts._fields}
    columns["z_missing"] = [of.z_blocked - of.z for of in found]
    columns["is_isostatic"] = [of.is_isostatic for of in found]
    return {name: mean_over(files, values) for name, values in columns.items()}


def averages(curve: Curve) -> Averages:
    """Average over the samples of each aspect ratio, end contacts over those of rods alone."""
    found: Averages = {
        name: {a: mean_over(of, [file.number(own) for file in of]) for a, of in curve.items()}
        for name, own in NAMES.items()
    }
    found["rattlers"] = {
        alpha: mean_over(of, [file.number("n_rattlers") / file.number("n") for file in of])
        for alpha, of in curve.items()
    }
    for alpha, files in curve.items():
        for name, mean in (ends_of(files) if alpha > 0 else {}).items():
            if name not in NAMES:
                found.setdefault(name, {})[alpha] = mean
    return found


def zero_modes(table: ModeTable) -> int:
    """Count the modes but translations whose eigenvalue is 0 within its bound."""
    return int(np.count_nonzero((table["sign"] == 0) & ~table["is_translation"]))


def slides_of(curve: Curve, modes: Path | None) -> dict[str, int]:
    """Count packings with modes in a folder, and those with as many zero modes as rods at neither end."""
    counts = {"with_modes": 0, "as_many": 0}
    for file in [one for alpha, files in curve.items() if alpha > 0 for one in files]:
        path = modes / f"{file.path.stem}.modes.h5" if modes else None
        if path and path.exists():
            found = file.contacts()
            free = np.count_nonzero(touched_ends(found)[~found.rattlers] == 0)
            counts["with_modes"] += 1
            counts["as_many"] += int(zero_modes(read_modes(path)) == free)
    return counts


def peak_of(phi_J: dict[float, Mean]) -> dict[str, Any]:
    """Find the aspect ratio of the largest phi_J."""
    alphas = sorted(phi_J)
    best = max(alphas, key=lambda alpha: phi_J[alpha].value)
    k = alphas.index(best)
    beside = alphas[max(k - 1, 0) : k + 2]
    return {"phi_J": phi_J[best], "alpha": best, "alpha_error": (beside[-1] - beside[0]) / 4}


def figure_from(found: Averages, title: str) -> Figure:
    """Draw the four panels."""
    figure = figure_of(10, 8, dpi=90)
    panels = figure.subplots(2, 2)
    spheres = discs_at(found["phi_J"])
    ours: dict[str, Any] = {"fmt": "o-", "color": BLUE, "label": "ours", "ms": 4}
    draw_density(panels[0, 0], found, spheres, ours)
    draw_contacts(panels[0, 1], found, spheres, ours)
    for name, (fmt, tint, text) in CONTACTS.items():
        error_bars(panels[1, 0], found[name], None, fmt=fmt, color=tint, mfc="none", label=text)
    panels[1, 0].set(ylabel="fraction", ylim=(-0.03, 1.03))
    error_bars(panels[1, 1], found["rattlers"], spheres, **ours)
    panels[1, 1].set_ylabel("fraction of rattlers")
    for axes in panels.flat:
        label_alpha_axis(axes, None if axes is panels[1, 0] else spheres)
        axes.legend(**SMALL_TEXT)
    panels[1, 0].legend(loc="upper left", bbox_to_anchor=(0, 0.95), **SMALL_TEXT)
    figure.suptitle(title, fontsize=8)
    return figure


def draw_density(axes: Axes, found: Averages, spheres: float, ours: dict[str, Any]) -> None:
    """Draw phi_J and the random contact law of long rods."""
    error_bars(axes, found["phi_J"], spheres, **ours)
    error_bars(axes, MAXIMUM, None, **PUBLISHED)
    law = [(a, z.value / excluded(a)) for a, z in sorted(found["z"].items()) if a >= THIN]
    label = r"random contacts, $z_J V/V_\mathrm{ex}$"
    axes.plot(*np.reshape(law, (-1, 2)).T, label=label, **PAPER_LINE)
    axes.set_ylabel(r"packing fraction $\phi_J$")


def excluded(alpha: float) -> float:
    """Return the volume that two rods of random directions exclude, over that of one (Onsager 1949)."""
    return (2 * np.pi * alpha**2 + 8 * np.pi * alpha + 16 * np.pi / 3) / (
        np.pi * alpha + 2 * np.pi / 3
    )


def draw_contacts(axes: Axes, found: Averages, spheres: float, ours: dict[str, Any]) -> None:
    """Draw z, the isostatic number of rods, and the same without rods that slide."""
    error_bars(axes, found["z"], spheres, **ours)
    error_bars(axes, found["z_blocked"], None, fmt="^-", color=ORANGE, mfc="none", ms=4,
               label=r"$8+2f_0$, less $4/N$")  # fmt: skip
    axes.axhline(10, label="isostatic rods", **PAPER_LINE)
    axes.set_ylabel("contacts per rod $z_J$")


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    groups = read_groups(
        options.files,
        needs=("alpha", "n_rattlers", *NAMES.values()),
        same=("n", "size_ratio", "u0"),
    )
    system, curve = one_curve(groups, "alpha")
    found = averages(curve)
    save_figure(figure_from(found, conditions_text(groups)), options.out)
    between = [a for a in curve if ISOSTATIC[0] <= a <= ISOSTATIC[1]]
    packings = {a: len(curve[a]) for a in between}
    isostatic = sum(round(found["is_isostatic"][a].value * packings[a]) for a in between)
    rods = [
        system.report() | {"alpha": a} | {name: of[a] for name, of in found.items() if a in of}
        for a in curve
    ]
    told = {
        "isostatic": isostatic,
        "packings": sum(packings.values()),
        "peak": peak_of(found["phi_J"]),
    }
    told |= slides_of(curve, options.modes)
    report({"out": options.out, "conditions": conditions(groups)} | told | {"rods": rods})


if __name__ == "__main__":
    parser = parser_of(__doc__, "end_contacts.png", "SWEEP")
    parser.add_argument("--modes", type=Path, help="folder of modes of the same packings")
    run(parser, main)
