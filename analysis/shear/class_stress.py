"""Fractions of pressure and shear stress carried by each class of contact, averaged over frames of the steady state.

    python analysis/shear/class_stress.py runs/shear/a4_*_g1e-5.h5 --out class_stress.png

Of rods: tip-to-tip, tip-to-side and side-to-side. Above, the part of the pressure; below, that of the shear stress -p_xy. What a
deck dumps by `compute contact/local` holds the same: the sum of ry fx over the rows of a kind. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.contacts import Contacts
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import ensemble_text
from jamshape.files.h5md import count_frames, read_packing
from jamshape.measures.averages import Mean
from jamshape.measures.shears import ShearOf, read_shear

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean
from common.axes import figure_of
from common.contact_classes import class_stress
from common.styles import color

CLASSES = ("tip-to-tip", "tip-to-side", "side-to-side")
PARTS = {"pressure": "fraction of the pressure", "shear_stress": "fraction of the shear stress"}


class Parts(NamedTuple):
    """Of one run: parts (3,) of pressure and shear stress, by class."""

    run: ShearOf
    means: dict[str, list[Mean]]


def parts_of(path: Path, after: float | None) -> Parts:
    """Average over the frames of the steady state."""
    of = read_shear(path, after)
    if of.steady is None:
        raise ValueError(of.problem)
    every = [read_packing(path, k) for k in range(count_frames(path))]
    gdot, begun = of.ensemble.gdot, of.steady.startup
    steady = [frame for frame in every if frame.time * gdot >= begun]
    tensors = [_by_class(Contacts.of(frame)) for frame in steady]
    pressure = np.array([np.trace(t, axis1=1, axis2=2) for t in tensors])
    stress = np.array([-t[:, 0, 1] for t in tensors])
    values = {"pressure": pressure, "shear_stress": stress}
    means = {
        name: [mean(x[:, k] / x.sum(axis=1).mean()) for k in range(3)] for name, x in values.items()
    }
    return Parts(of, means)


def _by_class(found: Contacts) -> FloatArray:
    known = class_stress(found)
    D = found.packing.dimension
    return np.array([known.get(k, np.zeros((D, D))) for k in range(3)])


def main(options: Namespace) -> None:
    """Read, average, draw, report."""
    found = sorted(
        (parts_of(path, options.after) for path in options.files), key=lambda p: p.run.ensemble.phi
    )
    figure = figure_of(5.5, 6, dpi=160)
    for axes, (name, label) in zip(figure.subplots(2, 1, sharex=True), PARTS.items(), strict=True):
        phi = [one.run.ensemble.phi for one in found]
        for k, kind in enumerate(CLASSES):
            bars = [one.means[name][k] for one in found]
            values = [one.value for one in bars], [one.error for one in bars]
            axes.errorbar(phi, *values, fmt="o-", ms=4, lw=0.9, color=color(k), label=kind)
        axes.set_ylabel(label)
    axes.set_xlabel(r"packing fraction $\phi$")
    axes.legend(fontsize=8, title="bars: standard error over frames", title_fontsize=8)
    first = found[0].run.ensemble
    figure.suptitle(f"{ensemble_text(first, ('n', 'gdot'))}, steady {first.flow} shear", fontsize=9)
    save_figure(figure, options.out)
    rows = [one.run.ensemble.report() | {"classes": CLASSES} | one.means for one in found]
    report({"out": options.out, "runs": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "class_stress.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
