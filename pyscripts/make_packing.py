"""Make one mechanically stable packing: compress, find the energy u0, measure, store as H5MD.

    python pyscripts/make_packing.py --shape spherocylinder --alpha 4 --n 256 --seed 1 --u0 1e-15 --out packing.h5

The last line of standard output is one JSON object; the exit code is 0 only if the minimum was
reached. Beside the result lie the compression (packing.h5.run.h5) and, until it is done, the
search: a run that was killed goes on from there when started again.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from tqdm import tqdm

from jamshape.approach import Approach
from jamshape.jammed import Sample, is_done, make, require_same, summary
from jamshape.target import Target


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--shape", choices=["spherocylinder"], default="spherocylinder")
    for name, default, meaning in (
        ("--alpha", 4.0, "aspect ratio A/R"),
        ("--n", 256, "particles"),
        ("--size-ratio", 1.4, "R_b/R_s"),
        ("--seed", 1, "of the random start"),
        ("--phi-start", 0.4, "packing fraction of the random start"),
        ("--kappa", 4e-7, "slowest compression rate"),
        ("--p-end", 1e-3, "pressure to compress to at that rate"),
        ("--u0", 1e-15, "energy density U/L^2 of the packing"),
        ("--accuracy", 1e-7, "of |u - u0|/u0"),
        ("--tolerance", 1e-8, "largest net force and torque over the mean bond force"),
    ):
        parser.add_argument(
            name, type=type(default), default=default, help=f"{meaning} ({default})"
        )
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--again", action="store_true", help="make it anew if it is there")
    return parser.parse_args()


def sample_of(options: argparse.Namespace) -> Sample:
    """Translate options into a sample."""
    return Sample(
        **{name: getattr(options, name) for name in ("n", "alpha", "size_ratio", "seed")},
        phi_start=options.phi_start,
        approach=Approach(kappa=options.kappa, p_end=options.p_end),
        target=Target(options.u0, options.accuracy, options.tolerance),
    )


def main(options: argparse.Namespace) -> int:
    """Make the packing unless it is there; return the exit code."""
    sample = sample_of(options)
    if options.again or not is_done(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
        with tqdm(make(sample, options.out, again=options.again), unit="row", mininterval=1) as bar:
            for at in bar:
                text = (
                    f"{at.stage} phi {at.phi:.6f} u {at.energy_density:.2e} res {at.residual:.1e}"
                )
                bar.set_postfix_str(text, refresh=False)
    else:
        require_same(options.out, sample)
    found = summary(options.out)
    print(json.dumps(found))
    return 0 if found["reached"] else 1


if __name__ == "__main__":
    try:
        sys.exit(main(parse()))
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"make_packing.py: {error}")
