"""Make one mechanically stable packing: compress, find its energy, measure, store as H5MD.

    python pyscripts/make_packing.py --shape spherocylinder --alpha 4 --n 256 --seed 1 --u0 1e-15 --out packing.h5
    python pyscripts/make_packing.py --shape superellipsoid --p 1.5 --w1 1 --w2 1 --n 400 --protocol 1 --seed 1 --out packing.h5

Spherocylinders as Marschall & Teitel 2018: 2D, compressed by LAMMPS, led to the energy density u0. Superellipsoids as Yuan
et al. 2019: 3D, compressed quasistatically to the first packing with U/N > 1e-10, and to u0 if given.

The last line of standard output is one JSON object; the exit code is 0 only if the minimum was
reached. Beside the result lies, until it is done, all that is needed to go on: a run that was killed does
so when started again.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jamshape.minima.target import Target
from jamshape.protocols import jammed, superellipsoid_jammed
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic

# Options with their types, defaults by shape (None: not an option of it) and meanings.
OPTIONS = (
    ("n", int, 256, 400, "particles"),
    ("seed", int, 1, 1, "of all that is random"),
    ("phi-start", float, 0.4, 0.1, "packing fraction of the random start"),
    ("tolerance", float, 1e-8, 1e-4, "largest net force and torque over the mean bond force"),
    ("u0", float, 1e-15, 0.0, "energy density U/L^D; 0: the first jammed packing as it is"),
    ("accuracy", float, 1e-7, 1e-7, "of |u - u0|/u0"),
    ("alpha", float, 4.0, None, "aspect ratio A/R"),
    ("size-ratio", float, 1.4, None, "R_b/R_s"),
    ("kappa", float, 4e-7, None, "slowest compression rate"),
    ("p-end", float, 1e-3, None, "pressure to compress to at that rate"),
    ("p", float, None, 1.0, "exponent: |x/a|^2p + |y/b|^2p + |z/c|^2p = 1"),
    ("w1", float, None, 1.0, "a/b <= 1"),
    ("w2", float, None, 1.0, "c/b >= 1"),
    ("protocol", int, None, 1, "2: with Monte Carlo of hard particles at phi-thermal"),
    ("phi-thermal", float, None, 0.55, "packing fraction of the Monte Carlo"),
    ("n-sweeps", int, None, 100_000, "sweeps of it"),
    ("delta-phi", float, None, 1e-3, "step of the packing fraction"),
)
SHAPES = ("spherocylinder", "superellipsoid")


def parse() -> argparse.Namespace:
    """Read the command line; defaults are those of the shape."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--shape", choices=SHAPES, default=SHAPES[0])
    for name, kind, *defaults, meaning in OPTIONS:
        known = {s: d for s, d in zip(SHAPES, defaults, strict=True) if d is not None}
        text = ", ".join(f"{s}s {d:g}" for s, d in known.items())
        parser.add_argument(f"--{name}", type=kind, help=f"{meaning} ({text})")
    parser.add_argument("--out", type=Path, required=True, help="H5MD file to write")
    parser.add_argument("--again", action="store_true", help="make it anew if it is there")
    options = parser.parse_args()
    for name, _, *defaults, _ in OPTIONS:
        key, default = name.replace("-", "_"), defaults[SHAPES.index(options.shape)]
        if getattr(options, key) is None:
            setattr(options, key, default)
        elif default is None:
            parser.error(f"--{name} is no option of {options.shape}s")
    return options


def sample_of(options: argparse.Namespace) -> jammed.Sample | superellipsoid_jammed.Sample:
    """Translate options into a sample."""
    if options.shape == "spherocylinder":
        return jammed.Sample(
            **{name: getattr(options, name) for name in ("n", "alpha", "size_ratio", "seed")},
            phi_start=options.phi_start,
            approach=Approach(kappa=options.kappa, p_end=options.p_end),
            target=Target(options.u0, options.accuracy, options.tolerance),
        )
    names = ("n", "p", "w1", "w2", "protocol", "seed", "phi_start", "phi_thermal", "n_sweeps")
    tight = (
        Target(options.u0, options.accuracy, min(options.tolerance, 1e-8)) if options.u0 else None
    )
    return superellipsoid_jammed.Sample(
        **{name: getattr(options, name) for name in names},
        quasistatic=Quasistatic(step=options.delta_phi, tolerance=options.tolerance),
        target=tight,
    )


def main(options: argparse.Namespace) -> int:
    """Make the packing unless it is there; return the exit code."""
    sample = sample_of(options)
    of_shape: Any = {SHAPES[0]: jammed, SHAPES[1]: superellipsoid_jammed}[options.shape]
    if options.again or not jammed.is_done(options.out):
        options.out.parent.mkdir(parents=True, exist_ok=True)
        steps = of_shape.make(sample, options.out, again=options.again)
        with tqdm(steps, unit="row", mininterval=1) as bar:
            for at in bar:
                text = (
                    f"{at.stage} phi {at.phi:.6f} u {at.energy_density:.2e} res {at.residual:.1e}"
                )
                bar.set_postfix_str(text, refresh=False)
    else:
        of_shape.require_same(options.out, sample)
    found = of_shape.summary(options.out)
    print(json.dumps(found))
    return 0 if found["reached"] else 1


if __name__ == "__main__":
    try:
        sys.exit(main(parse()))
    except (ValueError, OSError, RuntimeError) as error:
        sys.exit(f"make_packing.py: {error}")
