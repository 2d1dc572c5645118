"""Jammed discs that become rods of random directions: the singular limit of alpha to 0.

    python analysis/singular_limit.py runs/sweep --out runs/singular_limit

The check that closes Sec. III C of Marschall & Teitel, PRE 97, 012905: each disc of a jammed packing
is given a spine of random direction with A = alpha R, and the packing is brought to its energy
again. R stays, so that the unit of length does; the box is opened as far as keeps phi, since so nearly
round rods without gaps overlap too much for two bonds side to side. Discs are the packings with alpha = 0 of
the sweep, or are made, and its packings with --alpha are drawn beside what comes out. Packings that are in
the output folder are not made again. The last line of standard output is one JSON object; the exit code is 0
only if all packings are there and in equilibrium.
"""

from __future__ import annotations

import json
import math
import sys
import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from fig_contact_angles import angles_of, curve, draw
from fig_contact_classes import PAPER_FLAT
from fig_contact_classes import statistics as flat_statistics
from scipy.stats import ks_2samp
from sweep_files import Mean, Sample, Sweep, mean, read_sweep
from tqdm import tqdm

from jamshape.files.h5md import read_attributes, require_attributes
from jamshape.landscape import Landscape, State
from jamshape.minima.target import Target, TargetError, find
from jamshape.packing import Packing
from jamshape.protocols import jammed
from jamshape.protocols.approach import Approach

PAPER = {"flat": PAPER_FLAT[0.01].value, "z": 4.43, "rattlers": 34 / 1024}  # alpha = 0.01
NAMES = {"from_discs": "from discs", "compressed": "compressed rods"}

Row = dict[str, Any]


def parse() -> Namespace:
    """Read the command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("sweep", type=Path, nargs="*", metavar="SWEEP", help="folders or files")
    parser.add_argument("--alpha", type=float, default=0.01, help="A/R of the rods (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of the directions (%(default)s)")
    made = parser.add_argument_group("discs that are made where SWEEP has none")
    made.add_argument("--n", type=int, default=256, help="particles (%(default)s)")
    made.add_argument("--samples", type=int, default=6, help="seeds 1 to this (%(default)s)")
    made.add_argument("--kappa", type=float, default=1e-6, help="slowest rate (%(default)s)")
    made.add_argument("--u0", type=float, default=1e-15, help="energy density (%(default)s)")
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options = parser.parse_args()
    if not (math.isfinite(options.alpha) and options.alpha > 0):
        msg = f"alpha is {options.alpha}, expected A / R above 0"
        raise ValueError(msg)
    if options.seed < 0:
        msg = f"seed is {options.seed}, expected an integer from 0"
        raise ValueError(msg)
    if options.samples < 1:
        msg = f"samples is {options.samples}, expected at least 1"
        raise ValueError(msg)
    return options


def make_discs(options: Namespace) -> list[Path]:
    """Make jammed discs, unless they are there; return their files."""
    folder = options.out / "discs"
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"alpha0_seed{seed}.h5" for seed in range(1, options.samples + 1)]
    approach, target = Approach(kappa=options.kappa), Target(options.u0)
    for seed, path in enumerate(paths, 1):
        sample = jammed.Sample(options.n, 0.0, seed=seed, approach=approach, target=target)
        if jammed.is_done(path):
            jammed.require_same(path, sample)
            continue
        for _ in tqdm(jammed.make(sample, path), desc=path.stem, unit="row", mininterval=1):
            pass
    return paths


def with_spines(discs: Packing, alpha: float, seed: int) -> tuple[Packing, State]:
    """Give each disc a spine of random direction; return the rods and their state at the same phi."""
    if discs.half_length.any():
        msg = f"half lengths up to {discs.half_length.max():g}, expected discs"
        raise ValueError(msg)
    R = discs.radius
    rods = discs.with_(
        diameters=2 * np.column_stack([(1 + alpha) * R, R, R]),
        orientation=np.random.default_rng(seed).uniform(0, np.pi, discs.n),
    )
    return rods, State.of(rods).strained(math.sqrt(rods.phi / discs.phi) - 1)


def make(discs: Sample, options: Namespace) -> Sample:
    """Make the packing of rods from one of discs, unless it is there."""
    path: Path = options.out / f"alpha{options.alpha:g}_from_{discs.path.stem}.h5"
    known = {name: discs.attributes[name] for name in ("n", "size_ratio", "seed")}
    known |= {"alpha": options.alpha, "spine_seed": options.seed, "phi_discs": discs.number("phi")}
    target = Target(discs.number("u0"))
    known |= {name: getattr(target, name) for name in ("u0", "accuracy", "tolerance")}
    if jammed.is_done(path):
        require_attributes(path, known)
    else:
        began = time.perf_counter()
        rods, start = with_spines(discs.contacts()[0], options.alpha, options.seed)
        landscape = Landscape(rods)
        minimum = find(landscape, start, target)
        effort = {"wall_seconds": time.perf_counter() - began}
        effort |= {"evaluations": landscape.evaluations}
        jammed.write_minimum(path, landscape, minimum, known | effort)
    return Sample(path, read_attributes(path))


def make_all(discs: list[Sample], options: Namespace) -> tuple[list[Sample], list[str]]:
    """Make all packings; return them and the complaints of those that failed."""
    options.out.mkdir(parents=True, exist_ok=True)
    done, failed = [], []
    for sample in tqdm(discs, unit="packing"):
        try:
            done.append(make(sample, options))
        except TargetError as error:
            failed.append(f"{sample.path.name}: {error}")
    return done, failed


def overlap_over_limit(sample: Sample) -> float:
    """Compare the mean overlap of bonds with A^2/d, above which two bonds side to side become one."""
    packing, network, _ = sample.contacts()
    bonds = network.bonds
    A = packing.half_length[network.pairs[bonds.contact]].min(axis=1)
    return float(np.mean((bonds.reach - bonds.distance) * bonds.reach / A**2))


def row(samples: list[Sample], alpha: float) -> Row:
    """Average what is compared over samples."""
    flat = [flat_statistics(sample) for sample in samples]
    found = curve(alpha, samples)
    means: dict[str, Mean] = {
        name: mean([sample.number(name) for sample in samples])
        for name in ("phi_J", "z", "z_single")
    }
    means["rattlers"] = mean([s.number("n_rattlers") / s.number("n") for s in samples])
    for name in ("flat_of_backbone", "flat_of_all", "side_to_side"):
        means[name] = mean([numbers[name] for numbers in flat])
    means["angles_on_flat"] = found.on_flat
    means["overlap_over_limit"] = mean([overlap_over_limit(sample) for sample in samples])
    counts = {"samples": len(samples), "contacts": found.n_contacts, "peak": found.density.max()}
    return counts | {name: value.report() for name, value in means.items()}


def distance(groups: Iterable[list[Sample]]) -> float:
    """Largest difference of the cumulative distributions of contact angles."""
    first, second = (np.concatenate([angles_of(s) for s in samples]) for samples in groups)
    return float(ks_2samp(first, second).statistic)


def main(options: Namespace) -> int:
    """Make, count, draw, report; return the exit code."""
    sweep: Sweep = read_sweep(options.sweep) if options.sweep else {}
    if 0.0 not in sweep:
        sweep = read_sweep([*options.sweep, *make_discs(options)])
    done, failed = make_all(sweep[0.0], options)
    failed += [f"{s.path.name}: stalled" for s in done if not s.reached]
    groups = {
        "from_discs": [sample for sample in done if sample.reached],
        "compressed": sweep.get(options.alpha, []),
    }
    groups = {name: samples for name, samples in groups.items() if samples}
    report: Row = {"alpha": options.alpha, "paper": PAPER, "failed": failed}
    report |= {name: row(samples, options.alpha) for name, samples in groups.items()}
    if len(groups) == 2:
        report["kolmogorov_distance"] = distance(groups.values())
    if "from_discs" in groups:
        curves = {NAMES[name]: curve(options.alpha, group) for name, group in groups.items()}
        report["out"] = str(options.out / "singular_limit.png")
        draw(curves, done[0].attributes["n"], Path(report["out"]))
    print(json.dumps(report))
    return 1 if failed else 0


if __name__ == "__main__":
    try:
        sys.exit(main(parse()))
    except (OSError, ValueError, RuntimeError) as error:
        sys.exit(f"singular_limit.py: {error}")
