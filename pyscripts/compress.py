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

from jamshape.jamming import fit_onset
from tqdm import tqdm

from jamshape.initial import Mixture, random_packing
from jamshape.protocols import Compression, Recording, begin, is_finished, record, resume
from jamshape.session import Session
from jamshape.storage import read_observables


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--alpha", type=float, default=4.0, help="aspect ratio A/R (4)")
    parser.add_argument("--n", type=int, default=256, help="particles (256)")
    parser.add_argument("--kappa", type=float, default=1e-4, help="compression rate (1e-4)")
    parser.add_argument("--phi-start", type=float, default=0.4, help="of the random start (0.4)")
    parser.add_argument("--phi-end", type=float, default=0.9, help="(0.9)")
    parser.add_argument("--dt", type=float, default=0.05, help="time step (0.05)")
    parser.add_argument(
        "--sides", type=int, default=1, choices=(1, 2), help="bonds side to side (1)"
    )
    parser.add_argument("--size-ratio", type=float, default=1.4, help="R_b/R_s (1.4)")
    parser.add_argument("--seed", type=int, default=1, help="of the random start (1)")
    parser.add_argument("--rows", type=int, default=400, help="samples of p(phi) (400)")
    parser.add_argument("--frames", type=int, default=20, help="snapshots (20)")
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--resume", action="store_true", help="go on after a kill")
    return parser.parse_args()


def compress(options: argparse.Namespace) -> None:
    """Run, or go on."""
    with Session() as session:
        if options.resume and options.out.exists():
            run, to = resume(session, options.out)
        else:
            settings = Compression(options.kappa, options.phi_end, options.dt, options.sides)
            mixture = Mixture.bidisperse(options.alpha, options.size_ratio)
            start = random_packing(options.n, options.phi_start, options.seed, mixture)
            options.out.parent.mkdir(parents=True, exist_ok=True)
            made_from = {key: getattr(options, key) for key in ("alpha", "n", "seed", "size_ratio")}
            to = Recording(options.out, options.rows, options.frames, made_from)
            run = begin(session, settings, start, to)
        with tqdm(total=run.last_step, initial=session.step, unit="step") as bar:
            for sample in record(run, to):
                bar.set_postfix_str(f"phi {sample.observables['phi']:.4f}", refresh=False)
                bar.update(sample.step - bar.n)


def result(path: Path) -> dict[str, object]:
    """Summarise the run: its end and, where the pressure rises, the onset of jamming."""
    observables = read_observables(path)
    last = {name: float(observables[name][-1]) for name in ("phi", "p", "z", "S_2", "S_4")}
    try:
        fit = fit_onset(observables["phi"], observables["p"])
    except ValueError:  # the run ends below jamming
        return {"out": str(path), **last, "phi_J": None}
    return {"out": str(path), **last, "phi_J": fit.phi_J, "phi_J_error": fit.phi_J_error}


if __name__ == "__main__":
    arguments = parse()
    try:
        if not (arguments.resume and is_finished(arguments.out)):
            compress(arguments)
        print(json.dumps(result(arguments.out)))
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"compress.py: {error}")
