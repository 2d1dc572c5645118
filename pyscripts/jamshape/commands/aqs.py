"""Shear particles of any shape by small steps, each followed by a minimisation (athermal quasistatic shear, AQS).

    jamshape aqs --alpha 4 --n 256 --phi 0.9 --step 1e-3 --strain 0.5 --out aqs.h5

    jamshape aqs --start packing.h5 --step 1e-3 --amplitude 0.05 --cycles 10 --out cycles.h5
    jamshape aqs --start packing.h5 --pressure 1e-3 --box yy --step 1e-3 --strain 0.5 --out normal.h5
    jamshape aqs --start packing.h5 --pressure 1e-3 --stress-step 1e-5 --out yield.h5

Starts from the last frame of a file with particles (--start), or that of --frame, or compresses a random packing
quasistatically to --phi. The volume is held, or with --pressure the pressure, or with --box a normal stress. With
--stress-step the shear stress is raised instead of the strain, until the packing yields. The last line of standard output is one JSON object: the
final stress, the modulus of the first step, averages over the steady state, and the stress drops, each with the
strain and the stress before it, and the dissipated energy over the volume; with --amplitude also per_cycle, as of
`jamshape cycle`. not_at_rest counts rows in which forces do
not balance to --tolerance; the exit code is 0 only if there are none. Needs no LAMMPS. The same command resumes an
interrupted run and leaves a finished one alone; it refuses a file with other settings, unless --again replaces it.
With --seconds it stops in time, before a queue ends it: the exit code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from typing import Any

from jamshape.checks import RANGES, require_in
from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.front.run import QuasistaticShearFile
from jamshape.front.shearing import quasistatic_shear

GO_ON = "the same command resumes from the last checkpoint"

_DROPS = RANGES["share"]._replace(meaning="a fraction", also=(0.0,))


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(quasistatic_shear, __doc__)
    least = "omit drops below this fraction of the largest stress (%(default)s)"
    parser.add_argument("--least-drop", type=float, default=1e-2, help=least)
    return parser


def main(options: Namespace) -> None:
    """Begin or resume; a finished run is left alone."""
    require_in("--least-drop", options.least_drop, _DROPS)
    run = called(quasistatic_shear, options)
    at_end = ("strain", "phi", "stress", "pressure", "sigma", "mu", "z")
    found = {name: float(run[name][-1]) for name in at_end}
    found |= {"not_at_rest": int((~run.at_rest).sum()), "modulus": run.modulus(), **_steady(run)}
    if options.stress_step is not None:
        found["yield_stress"] = run.yield_stress and run.yield_stress._asdict()
    found |= {"per_cycle": run.cycles()} if run.steps_per_cycle else {}
    report({"out": options.out, **found, "events": run.events(options.least_drop)})


def _steady(run: QuasistaticShearFile) -> dict[str, Any]:
    """Average over the steady state, or report why there is none."""
    try:
        return run.steady().report()
    except ValueError as error:  # too short
        return {"steady": str(error)}
