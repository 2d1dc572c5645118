"""Jammed discs that become rods of random directions: the singular limit of alpha to 0.

    python analysis/marschall_2018/singular_limit.py runs/sweep --out runs/singular_limit

The check that closes Sec. III C of Marschall & Teitel, PRE 97, 012905: each disc of a jammed packing
is given a spine of random direction with A = alpha R, and the packing is brought to its energy
again. R stays, so that the unit of length does; the box is opened as far as keeps phi, since so nearly
round rods without gaps overlap too much for two bonds side to side. Discs are the packings with alpha = 0 of
the sweep, or are made, and its packings with --alpha are drawn beside what comes out. Packings that are in
the output folder are not made again. The last line of standard output is one JSON object; the exit code is 0
only if all packings are there and in equilibrium.
"""

from __future__ import annotations

import math
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import ks_2samp
from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.ensembles import PackingFile
from jamshape.files.h5md import require_attributes
from jamshape.files.outcomes import shortfall
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import write_minimum
from jamshape.minima.target import Target, TargetError, find
from jamshape.protocols.approach import Approach
from jamshape.protocols.make import Dynamics, Recipe, is_done, make, require_same
from jamshape.recording.recorder import How
from jamshape.shapes.particles import Particles

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.averages import mean_over
from common.contact_angles import angle_curve, angles_of, contact_angle_figure
from common.contact_classes import class_numbers
from common.ensembles import Curve, is_among, one_curve, read_groups
from common.spines import with_spines
from common.text import conditions_alone

# At alpha = 0.01; "virtually all the particles (96.3% of them)" have a flat contact (Sec. III C).
PAPER = {"flat": 0.963, "z": 4.43, "rattlers": 34 / 1024}
NAMES = {"from_discs": "from discs", "compressed": "compressed rods"}

Row = dict[str, Any]


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__)
    found.add_argument("sweep", type=Path, nargs="*", metavar="SWEEP", help="folders or files")
    found.add_argument("--alpha", type=float, default=0.01, help="A/R of the rods (%(default)s)")
    found.add_argument("--seed", type=int, default=1, help="of the directions (%(default)s)")
    made = found.add_argument_group("discs that are made where SWEEP has none")
    made.add_argument("--n", type=int, default=256, help="particles (%(default)s)")
    made.add_argument("--samples", type=int, default=6, help="seeds 1 to this (%(default)s)")
    made.add_argument("--kappa", type=float, default=1e-6, help="slowest rate (%(default)s)")
    made.add_argument("--u0", type=float, default=1e-15, help="energy density (%(default)s)")
    found.add_argument("--out", type=Path, required=True, help="folder")
    return found


def check(options: Namespace) -> None:
    """Refuse numbers out of their range.

    Raises
    ------
    ValueError
    """
    if not (math.isfinite(options.alpha) and options.alpha > 0):
        msg = f"alpha is {options.alpha}, expected A / R above 0"
        raise ValueError(msg)
    if options.seed < 0:
        msg = f"seed is {options.seed}, expected an integer from 0"
        raise ValueError(msg)
    if options.samples < 1:
        msg = f"samples is {options.samples}, expected at least 1"
        raise ValueError(msg)


def _make(recipe: Recipe, path: Path) -> None:
    with tqdm(desc=path.stem, unit="row", mininterval=1) as bar:
        make(recipe, path, How(tell=lambda _: bar.update()))


def make_discs(options: Namespace) -> list[Path]:
    """Make jammed discs, unless they are there; return their files."""
    folder = options.out / "discs"
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"alpha0_seed{seed}.h5" for seed in range(1, options.samples + 1)]
    way, target = Dynamics(Approach(kappa=options.kappa)), Target(options.u0)
    for seed, path in enumerate(paths, 1):
        recipe = Recipe(Particles.of(alpha=0.0), options.n, seed=seed, way=way, target=target)
        if is_done(path):
            require_same(path, recipe)
            continue
        _make(recipe, path)
    return paths


def read(paths: list[Path]) -> Curve:
    """Read a sweep, by alpha."""
    groups = read_groups(paths, needs=["alpha"], same=("n", "size_ratio", "u0"))
    return one_curve(groups, "alpha")[1]


def lead(discs: PackingFile, options: Namespace) -> PackingFile:
    """Make the packing of rods from one of discs, unless it is there."""
    path: Path = options.out / f"alpha{options.alpha:g}_from_{discs.path.stem}.h5"
    known = {name: discs.attributes[name] for name in ("n", "size_ratio", "seed")}
    known |= {"alpha": options.alpha, "spine_seed": options.seed, "phi_discs": discs.number("phi")}
    target = Target(discs.number("u0"))
    known |= {name: getattr(target, name) for name in ("u0", "accuracy", "tolerance")}
    if is_done(path):
        require_attributes(path, known)
    else:
        began = time.perf_counter()
        rods = with_spines(discs.packing(), options.alpha, options.seed)
        landscape = Landscape(rods)
        minimum = find(landscape, State.of(rods), target)
        effort = {"wall_seconds": time.perf_counter() - began}
        effort |= {"evaluations": landscape.evaluations}
        write_minimum(path, landscape, minimum, known | effort)
    return PackingFile.read(path)


def lead_all(discs: list[PackingFile], options: Namespace) -> tuple[list[PackingFile], list[str]]:
    """Make all packings; return them and the complaints of those that failed."""
    options.out.mkdir(parents=True, exist_ok=True)
    done, failed = [], []
    for file in tqdm(discs, unit="packing"):
        try:
            done.append(lead(file, options))
        except TargetError as error:
            failed.append(f"{file.path.name}: {error}")
    failed += [f"{f.path.name}: {shortfall(f.attributes)}" for f in done if not f.reached]
    return done, failed


def overlap_over_limit(file: PackingFile) -> float:
    """Compare the mean overlap of bonds with A^2/d, above which two bonds side to side become one."""
    found = file.contacts()
    packing, network, bonds = found.packing, found.network, found.network.bonds
    A = packing.half_length[network.pairs[bonds.contact]].min(axis=1)
    return float(np.mean((bonds.reach - bonds.distance) * bonds.reach / A**2))


def row_of(files: list[PackingFile], alpha: float) -> Row:
    """Average what is compared over samples."""
    flat = [class_numbers(file.contacts()) for file in files]
    found = angle_curve(alpha, files)
    parts = [file.number("n_rattlers") / file.number("n") for file in files]
    numbers = {n: [f.number(n) for f in files] for n in ("phi_J", "z", "z_single")}
    numbers |= {"rattlers": parts, "overlap_over_limit": [overlap_over_limit(f) for f in files]}
    names = ("flat_of_backbone", "flat_of_all", "side_to_side")
    numbers |= {name: [of[name] for of in flat] for name in names}
    means = {name: mean_over(files, values) for name, values in numbers.items()}
    means["angles_on_flat"] = found.on_flat
    counts = {"samples": len(files), "contacts": found.n_contacts, "peak": found.density.max()}
    return counts | means


def distance(groups: Iterable[list[PackingFile]]) -> float:
    """Largest difference of the cumulative distributions of contact angles."""
    first, second = (np.concatenate([angles_of(f) for f in files]) for files in groups)
    return float(ks_2samp(first, second).statistic)


def main(options: Namespace) -> int:
    """Make, count, draw, report; return the exit code."""
    check(options)
    sweep = read(options.sweep) if options.sweep else {}
    if 0.0 not in sweep:
        sweep = read([*options.sweep, *make_discs(options)])
    done, failed = lead_all(sweep[0.0], options)
    compressed = [of for alpha, of in sweep.items() if is_among(alpha, [options.alpha])]
    groups = {"from_discs": done}
    groups["compressed"] = [file for of in compressed for file in of]
    groups = {name: files for name, files in groups.items() if files}
    found: Row = {"alpha": options.alpha, "paper": PAPER, "failed": failed}
    found |= {name: row_of(files, options.alpha) for name, files in groups.items()}
    if len(groups) == 2:
        found["kolmogorov_distance"] = distance(groups.values())
    if "from_discs" in groups:
        curves = {NAMES[name]: angle_curve(options.alpha, of) for name, of in groups.items()}
        title = conditions_alone(groups)
        found["out"] = options.out / "singular_limit.png"
        save_figure(contact_angle_figure(curves, title), found["out"])
    report(found)
    return 1 if failed else 0


if __name__ == "__main__":
    run(parser(), main)
