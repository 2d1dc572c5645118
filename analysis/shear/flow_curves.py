"""Draw flow curves, pressure against shear rate, and find the packing fraction at which the flow jams.

    python analysis/shear/flow_curves.py runs/shear/*.h5 --out flow_curves.png

Runs of `jamshape shear` of one kind of particles at several packing fractions and rates. To each packing fraction with
three rates p = p_0 + c gdot^b is fitted (Herschel & Bulkley; Marschall, Keta, Olsson & Teitel, Phys. Rev. Lett. 122, 188002
(2019)). phi_J of shear is where the line through the yield pressures p_0 begins, and where p/gdot diverges as
(phi_J - phi)^-beta below. The last line of standard output is one JSON object with all fits.
"""

from __future__ import annotations

from argparse import Namespace

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.drawing.flow_curves import flow_curve_figure
from jamshape.drawing.saving import save_figure
from jamshape.measures.flow_curves import FlowCurve, fit_flow_curve, shear_onset
from jamshape.measures.shears import ShearOf, read_shear


def curves_of(runs: list[ShearOf]) -> list[FlowCurve]:
    """Fit a curve to each packing fraction; samples that differ in their seed are points of their own."""
    by_phi: dict[float, list[ShearOf]] = {}
    for one in runs:
        by_phi.setdefault(one.ensemble.phi, []).append(one)
    curves = []
    for phi, of in sorted(by_phi.items()):
        means = [one.steady["pressure"] for one in of if one.steady]
        rates = np.array([one.ensemble.gdot for one in of])
        values, errors = (
            np.array([getattr(m, name) for m in means]) for name in ("value", "error")
        )
        curves.append(fit_flow_curve(phi, rates, values, errors))
    return curves


def main(options: Namespace) -> None:
    """Read, fit, draw, report."""
    every = [read_shear(path, options.after) for path in options.files]
    runs = [one for one in every if one.steady]
    systems = {one.ensemble.system for one in runs}
    if len(systems) != 1:
        msg = (
            f"runs of {len(systems)} systems with a steady state were given, expected those of one"
        )
        raise ValueError(msg)
    curves = curves_of(runs)
    onset = shear_onset(curves)
    save_figure(flow_curve_figure(curves, onset, runs[0].ensemble), options.out)
    rows = [{"phi": c.phi, "p_0": c.yields, "p_0_error": c.yields_error, "c": c.factor, "b": c.power,
             "eta_p": c.viscosity.value} for c in curves]  # fmt: skip
    report({"out": options.out, **runs[0].ensemble.system.report(), "phi_J": onset, "curves": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__, "flow_curves.png", "RUN.h5")
    parser.add_argument("--after", type=float, help="strain from which to average (chosen)")
    run(parser, main)
