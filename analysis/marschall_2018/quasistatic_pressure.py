"""Compress jammed packings by equal steps of phi, then open them again: for phi_J of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/quasistatic_pressure.py PACKING.h5 [MORE.h5 ...] --phi-end 0.92 --out QUASISTATIC

Each packing is compressed by equal steps of phi, with a minimisation after each one, up to --phi-end. Writes phi and the
pressure after each step to PACKING.csv in the folder --out, and there, as PACKING.h5, the packing that is left when the box
is opened from --phi-end until its energy density is --u0. Files that are there are not made again. The last line of
standard output is one JSON object.
"""

from __future__ import annotations

import csv
import math
import sys
import time
from argparse import ArgumentParser, Namespace
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.checks import require_positive
from jamshape.command import parser_of, report, run
from jamshape.files.ensembles import PackingFile
from jamshape.files.outcomes import shortfall
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import energy_onset, write_minimum
from jamshape.minima import Minimum
from jamshape.minima.target import Target
from jamshape.protocols.ladder import bring
from jamshape.protocols.quasistatic import compressed_to

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.ensembles import finished

COLUMNS = ("phi", "pressure", "u")

# Energy density over its target from which the search for it takes over from steps that halve phi - phi_J.
NEAR = 1e6

# Attributes that identify the packing and that the opened one shares with it.
KEPT = ("alpha", "n", "seed", "size_ratio", "protocol")


def parser() -> ArgumentParser:
    """Describe the command line."""
    found = parser_of(__doc__)
    found.add_argument("packings", type=Path, nargs="+", metavar="PACKING", help="jammed packings")
    found.add_argument("--phi-end", type=float, default=0.92, help="final phi (%(default)s)")
    found.add_argument("--step", type=float, default=1e-3, help="step of phi (%(default)s)")
    energy = "energy density of the opened packing (that of PACKING)"
    found.add_argument("--u0", type=float, help=energy)
    found.add_argument("--out", type=Path, required=True, help="folder")
    return found


def numbers(landscape: Landscape, state: State) -> dict[str, float]:
    """Return phi, the pressure and the energy density of a state."""
    found, volume = landscape.evaluate(state), state.volume
    phi = float(landscape.particles.measures.sum()) / volume
    pressure = -found.strain_gradient / (state.dimension * volume)
    return {"phi": phi, "pressure": pressure, "u": found.energy / volume}


def compressed(
    landscape: Landscape, state: State, phi_end: float, step: float
) -> Iterator[tuple[State, dict[str, float]]]:
    """Compress a packing by equal steps, and yield the minimum after each one with its numbers."""
    row = numbers(landscape, state)
    yield state, row
    for phi in np.linspace(row["phi"], phi_end, math.ceil((phi_end - row["phi"]) / step) + 1)[1:]:
        state = compressed_to(landscape, state, float(phi), step=math.inf)
        yield state, numbers(landscape, state)


def opened(landscape: Landscape, state: State, target: Target) -> Minimum:
    """Open the box to the target energy, in steps that the particles can follow."""
    row = numbers(landscape, state)
    while row["u"] > NEAR * target.u0:
        onset = energy_onset(row["phi"], row["u"], row["pressure"], landscape.law.power)
        state = compressed_to(landscape, state, (row["phi"] + onset) / 2, step=math.inf)
        row = numbers(landscape, state)
    return bring(landscape, state, target)


def treat(source: PackingFile, options: Namespace) -> dict[str, Any]:
    """Compress and open one packing; read what is there already."""
    table, out = (options.out / f"{source.path.stem}{end}" for end in (".csv", ".h5"))
    if out.is_file() and table.is_file():
        return row_of(PackingFile.read(out))
    began, packing = time.perf_counter(), source.packing()
    landscape, rows = Landscape(packing), []
    for found, row in compressed(landscape, State.of(packing), options.phi_end, options.step):
        rows.append(row)
        state = found
    with table.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
    u0 = options.u0 or source.number("u0")
    target = Target(u0, source.number("accuracy"), source.number("tolerance"))
    minimum = opened(landscape, state, target)
    told = {name: source.attributes[name] for name in KEPT if name in source.attributes}
    told |= {name: getattr(target, name) for name in ("u0", "accuracy", "tolerance")}
    told |= {"phi_end": options.phi_end, "step": options.step, "evaluations": landscape.evaluations}
    write_minimum(out, landscape, minimum, told | {"wall_seconds": time.perf_counter() - began})
    return row_of(PackingFile.read(out))


def row_of(file: PackingFile) -> dict[str, Any]:
    """Report an opened packing."""
    names = ("alpha", "seed", "phi_J", "z", "z_bearing", "residual", "wall_seconds")
    told = {name: file.attributes[name] for name in names if name in file.attributes}
    return {"out": file.path, "reached": file.reached} | told


def main(options: Namespace) -> int:
    """Compress and open every packing; return the exit code."""
    require_positive(step=options.step, phi_end=options.phi_end)
    options.out.mkdir(parents=True, exist_ok=True)
    rows = []
    for source in tqdm(finished(options.packings), unit="packing"):
        if source.number("phi") >= options.phi_end:
            msg = f"--phi-end is {options.phi_end:g}, but {source.path} has phi = {source.number('phi'):.5g}; give a larger one"
            raise ValueError(msg)
        rows.append(treat(source, options))
        if said := shortfall(PackingFile.read(rows[-1]["out"]).attributes):
            tqdm.write(f"{rows[-1]['out'].name}: {said}", file=sys.stderr)
    reached = sum(row["reached"] for row in rows)
    report({"reached": reached, "packings": rows})
    return 0 if reached == len(rows) else 1


if __name__ == "__main__":
    run(parser(), main)
