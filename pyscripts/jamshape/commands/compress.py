"""Compress particles of any shape through jamming; record p(phi) and snapshots in one H5MD file.

    jamshape compress --alpha 4 --n 1024 --kappa 1e-6 --phi-start 0.4 --phi-end 0.9 --out run.h5

The last line of standard output is one JSON object. With --resume a killed run goes on from its
last restart file, with the settings it began with, and a finished one is left alone.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from tqdm import tqdm

from jamshape.command import parser_of, report
from jamshape.flow.compression import Compression
from jamshape.flow.recording import Recording, begin, is_finished, record, resume, summary_of
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.command_line import add_particle_options, particles_of

GO_ON = "the same command with --resume goes on from the last restart file"


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    add_particle_options(parser)
    for name, default, meaning in (
        ("--n", 256, "particles"),
        ("--dimension", 2, "2 or 3"),
        ("--kappa", 1e-4, "compression rate"),
        ("--phi-start", 0.4, "packing fraction of the random start"),
        ("--phi-end", 0.9, "packing fraction to reach"),
        ("--integrator", "heun", "heun, heun/adaptive or rkc2"),
        ("--dt", 0.05, "time step of heun"),
        ("--tolerance", 1e-4, "of the others: local error over the typical overlap"),
        ("--sides", 1, "bonds of a side-to-side contact, 1 or 2"),
        ("--seed", 1, "of the random start"),
        ("--rows", 400, "samples of p(phi)"),
        ("--frames", 20, "snapshots"),
    ):
        parser.add_argument(
            name, type=type(default), default=default, help=f"{meaning} ({default})"
        )
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--resume", action="store_true", help="go on after a kill")
    return parser


def fresh(options: Namespace) -> tuple[Compression, Packing, Recording]:
    """Make settings and initial state, before LAMMPS is started."""
    names = ("kappa", "phi_end", "dt", "sides", "integrator", "tolerance")
    settings = Compression(**{name: getattr(options, name) for name in names})
    if settings.chooses_steps:
        settings = settings.in_steps(options.phi_start, options.rows, options.dimension)
    particles, at = particles_of(options), (options.n, options.phi_start, options.seed)
    start = random_packing(*at, particles, options.dimension)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    made_from = dict(particles.told) | {"n": options.n, "seed": options.seed}
    return settings, start, Recording(options.out, options.rows, options.frames, made_from)


def compress(options: Namespace) -> None:
    """Run, or go on."""
    new = None if options.resume and options.out.exists() else fresh(options)
    with Session() as session:
        run_, to = (begin(session, *new), new[2]) if new else resume(session, options.out)
        with tqdm(total=run_.last_step, initial=session.step, unit="step", mininterval=1) as bar:
            for row in record(run_, to):
                bar.set_postfix_str(f"phi {row.observables['phi']:.4f}", refresh=False)
                bar.update(row.step - bar.n)


def main(options: Namespace) -> None:
    """Compress unless it is done, and report."""
    if not (options.resume and is_finished(options.out)):
        compress(options)
    report(summary_of(options.out))
