"""Compress particles of any shape in the plane through jamming at any rate, however slow; record p(phi).

    jamshape slow --alpha 4 --n 256 --kappa 1e-9 --phi-end 0.88 --out slow.h5

Starts from the last frame of a run or packing file (--start), or compresses a random packing fast in
LAMMPS first. Run again after a kill, it goes on; a finished run is left alone. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jamshape.command import parser_of, report
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.flow.implicit import METHODS, Protocol
from jamshape.flow.slow_recording import begin, is_finished, record, require_same, summary_of
from jamshape.packing import Packing
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.command_line import add_particle_options, particles_of

PHI_RANDOM = 0.4  # of the random start

GO_ON = "the same command goes on from the last frame"


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    for name, default, meaning in (
        ("--n", 256, "particles"),
        ("--kappa", 1e-8, "compression rate"),
        ("--phi-start", 0.8, "packing fraction where the fast compression ends"),
        ("--phi-slow", 0.0, "packing fraction from which --kappa holds; before it --kappa-before"),
        ("--kappa-before", 1e-6, "compression rate up to --phi-slow"),
        ("--phi-end", 0.9, "packing fraction to reach"),
        ("--p-end", math.inf, "pressure to reach"),
        ("--seed", 1, "of the random start"),
        ("--tolerance", 1e-3, "local error of a step over the typical overlap"),
        ("--largest-drop", math.inf, "part of the energy that a step may lose (plastic events)"),
    ):
        parser.add_argument(
            name, type=type(default), default=default, help=f"{meaning} ({default})"
        )
    parser.add_argument("--method", choices=METHODS, default="tr-bdf2")
    parser.add_argument("--start", type=Path, help="H5MD file whose last frame to start from")
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    return parser


def protocol_of(options: Namespace) -> Protocol:
    """Read how to compress."""
    slowly = (options.phi_slow, options.kappa)
    kappa = ((0.0, options.kappa_before), slowly) if options.phi_slow else options.kappa
    return Protocol(kappa, options.phi_end, options.p_end, options.tolerance,
                    largest_drop=options.largest_drop, method=options.method)  # fmt: skip


def start_of(options: Namespace) -> tuple[Packing, dict[str, Any]]:
    """Read or make the start, and say what it was made from."""
    particles = particles_of(options)
    made_from: dict[str, Any] = {"n": options.n, "seed": options.seed}
    if not options.start:
        start = random_packing(options.n, PHI_RANDOM, options.seed, particles)
        return compressed_start(start, options.phi_start), dict(particles.told) | made_from
    start, stored = read_packing(options.start), read_attributes(options.start)
    known = {key: stored[key] for key in (*particles.told, "seed") if key in stored}
    return start, known | {"n": start.n, "start": str(options.start)}


def main(options: Namespace) -> None:
    """Begin, or go on; a finished run is left alone."""
    protocol = protocol_of(options)
    if options.out.exists():
        require_same(options.out, protocol)
    else:
        start, made_from = start_of(options)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        begin(options.out, start, protocol, made_from)
    if not is_finished(options.out):
        with tqdm(total=round(1e6 * options.phi_end), unit="1e-6 phi", mininterval=1) as bar:
            for step in record(options.out):
                bar.set_postfix_str(f"phi {step.phi:.6f} p {step.pressure:.3e}", refresh=False)
                bar.update(round(1e6 * step.phi) - bar.n)
    report(summary_of(options.out))
