"""Compress 2D spherocylinders through jamming; record p(phi) and snapshots in one H5MD file.

    python pyscripts/compress.py --alpha 4 --n 1024 --kappa 1e-6 --phi-start 0.4 --phi-end 0.9 --out run.h5

The last line of standard output is one JSON object. With --resume a killed run goes on from its
last restart file, with the settings it began with, and a finished one is left alone.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from tqdm import tqdm

from jamshape.flow.compression import (
    Compression,
    Recording,
    begin,
    is_finished,
    record,
    resume,
    summary,
)
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name, default, meaning in (
        ("--alpha", 4.0, "aspect ratio A/R"),
        ("--n", 256, "particles"),
        ("--kappa", 1e-4, "compression rate"),
        ("--phi-start", 0.4, "packing fraction of the random start"),
        ("--phi-end", 0.9, "packing fraction to reach"),
        ("--integrator", "heun", "heun, heun/adaptive or rkc2"),
        ("--dt", 0.05, "time step of heun"),
        ("--tolerance", 1e-4, "of the others: local error over the typical overlap"),
        ("--sides", 1, "bonds of a side-to-side contact, 1 or 2"),
        ("--size-ratio", 1.4, "R_b/R_s"),
        ("--seed", 1, "of the random start"),
        ("--rows", 400, "samples of p(phi)"),
        ("--frames", 20, "snapshots"),
    ):
        parser.add_argument(
            name, type=type(default), default=default, help=f"{meaning} ({default})"
        )
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--resume", action="store_true", help="go on after a kill")
    return parser.parse_args()


def fresh(options: argparse.Namespace) -> tuple[Compression, Packing, Recording]:
    """Make settings and initial state, before LAMMPS is started."""
    names = ("kappa", "phi_end", "dt", "sides", "integrator", "tolerance")
    settings = Compression(**{name: getattr(options, name) for name in names})
    if settings.chooses_steps:
        settings = settings.in_steps(options.phi_start, options.rows)
    mixture = Mixture.bidisperse(options.alpha, options.size_ratio)
    start = random_packing(options.n, options.phi_start, options.seed, mixture)
    options.out.parent.mkdir(parents=True, exist_ok=True)
    made_from = {key: getattr(options, key) for key in ("alpha", "n", "seed", "size_ratio")}
    return settings, start, Recording(options.out, options.rows, options.frames, made_from)


def compress(options: argparse.Namespace) -> None:
    """Run, or go on."""
    new = None if options.resume and options.out.exists() else fresh(options)
    with Session() as session:
        run, to = (begin(session, *new), new[2]) if new else resume(session, options.out)
        with tqdm(total=run.last_step, initial=session.step, unit="step", mininterval=1) as bar:
            for sample in record(run, to):
                bar.set_postfix_str(f"phi {sample.observables['phi']:.4f}", refresh=False)
                bar.update(sample.step - bar.n)


if __name__ == "__main__":
    arguments = parse()
    try:
        if not (arguments.resume and is_finished(arguments.out)):
            compress(arguments)
        print(json.dumps(summary(arguments.out)))
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"compress.py: {error}")
