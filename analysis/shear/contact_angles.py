"""Draw the distribution of contacts over the surface of sheared particles, over the steady state.

    python analysis/shear/contact_angles.py runs/shear/a4_phi0.90_g1e-5.h5 runs/shear/a0.01_phi0.84_g1e-5.h5

P(phi) is the probability density of a contact at the polar angle phi about the centre from the spine, of all frames of the
steady state of each run, the four quarters of a particle taken as one; as Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett.
122, 188002 (2019). The last line of standard output is one JSON object with the height of the peak and how much of P is
on the flat sides.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.contacts import Contacts
from jamshape.drawing.saving import save_figure
from jamshape.drawing.text import scientific
from jamshape.files.h5md import count_frames, read_packing
from jamshape.measures.shears import ShearOf, read_shear

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.contact_angles import AngleCurve, contact_angle_figure, contact_angles, curve_of_angles


class Found(NamedTuple):
    """A run and its curve."""

    run: ShearOf
    curve: AngleCurve

    @property
    def label(self) -> str:
        """What tells it from others."""
        of = self.run.ensemble
        alpha = of.system.number("alpha")
        return rf"$\alpha={alpha:g}$, $\phi={of.phi:.4g}$, $\dot\gamma={scientific(of.gdot)}$"


def found_in(path: Path, after: float | None) -> Found:
    """Count the contacts of the frames of a steady state."""
    of = read_shear(path, after)
    if of.steady is None:
        raise ValueError(of.problem)
    frames = (read_packing(path, k) for k in range(count_frames(path)))
    begun = of.steady.startup / of.ensemble.gdot
    every = [Contacts.of(frame) for frame in frames if frame.time >= begun]
    angles = [contact_angles(one.packing, one.network, one.rattlers) for one in every]
    return Found(of, curve_of_angles(of.ensemble.system.number("alpha"), angles))


def main(options: Namespace) -> None:
    """Read, count, draw, report."""
    found = [found_in(path, options.after) for path in options.files]
    first = found[0].run.ensemble
    title = (
        f"{first.system.shape}s in 2D, $N={first.n}$, steady {first.flow} shear; samples are frames"
    )
    save_figure(contact_angle_figure({one.label: one.curve for one in found}, title), options.out)
    rows = [
        one.run.ensemble.report()
        | {"frames": one.curve.samples, "contacts": one.curve.n_contacts}
        | {"peak": one.curve.density.max(), "peak_degrees": one.curve.peak_degrees}
        | {"on_flat": one.curve.on_flat}
        for one in found
    ]
    report({"out": options.out, "contact_angles": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "contact_angles.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
