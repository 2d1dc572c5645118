"""Take a packing of any shape through energies or pressures, and list the contacts that change from state to state.

    jamshape ladder packing.h5 --u0 1e-6 1e-8 1e-10 --out ladder.h5
    jamshape ladder packing.h5 --pressure 1e-3 1e-4 1e-5 --box free --out ladder.h5

The packing is an H5MD file, whose last frame is taken; values follow in the order given. The last line of standard
output is one JSON object: for each value its state, and the numbers of contacts that opened and closed on the way to
it, which --within encloses closely. The exit code is 0 only if forces balance at each value. The same command resumes
an interrupted run and leaves a finished one alone; it refuses a file with other settings, unless --again replaces it.
With --seconds it stops in time, before a queue ends it: the exit code is then 75.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from jamshape.arrays import IntArray
from jamshape.checks import require_other_file
from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.drawing.saving import require_picture, save_figure
from jamshape.front.laddering import ladder
from jamshape.front.run import LadderFile

GO_ON = "the same command resumes from the last checkpoint"

_STATE = ("u", "phi", "pressure", "z", "rattlers", "residual")


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(ladder, __doc__)
    within = (
        "list each change between two values whose relative distance is at most this, by bisection"
    )
    parser.add_argument("--within", type=float, help=within)
    back = "take the packing back over each change, to see if it returns"
    parser.add_argument("--step-back", action="store_true", help=back)
    parser.add_argument(
        "--plot", type=Path, help="figure of z and of the changes against the values"
    )
    return parser


def main(options: Namespace) -> None:
    """Begin or resume, compare contacts, draw, report."""
    if options.plot:
        require_other_file(options.plot, [options.out, options.packing])
        require_picture(options.plot)
    run = called(ladder, options)
    if options.plot:
        _save_plot(run, options.plot)
    changed = {"opened": run.opened, "closed": run.closed}
    found: dict[str, Any] = {name: values.sum() for name, values in changed.items()}
    found["states"] = [_state(run, changed, k) for k in range(len(run))]
    if options.within is not None or options.step_back:
        changes = run.contact_changes(within=options.within, step_back=options.step_back)
        if options.step_back:
            found["irreversible"] = sum(one.returns is False for one in changes)
        found["changes"] = changes
    report({"out": options.out, **found})


def _state(run: LadderFile, changed: dict[str, IntArray], k: int) -> dict[str, Any]:
    """Describe a state, and the changes on the way to it."""
    found = {run.parameter: run.values[k], "reached": run.reached[k]}
    found |= {name: run[name][k] for name in _STATE}
    return found | {name: values[k] for name, values in changed.items()}


def _save_plot(run: LadderFile, path: Path) -> None:
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help

    figure = Figure(figsize=(5, 3.6), layout="constrained")
    run.plot(figure.add_subplot())
    save_figure(figure, path, dpi=200)
