"""Cost of our rods against LAMMPS's own rods and discs, on the same states, in one go.

    python analysis/benchmark_pair.py --quick
    python analysis/benchmark_pair.py --only ours-one --phi 0.86 --n 1024 --measure force
    python analysis/benchmark_pair.py --only ours-one ours-two --against OLD_PLUGIN.so

ours-one, ours-two: spherocylinder/harmonic; polygon: body/rounded/polygon with the same centres,
angles, spines and radii; wca: lj/cut discs whose force ends at contact, the same N and phi.

  force   `run M` without integrator: each step is one force evaluation on a kept neighbour list
  step    the whole compression step, lists rebuilt as needed: two evaluations, box, drag, rotation
  memory  slope of the peak resident set against N (one state tiled 3 x 3 to 6 x 6), integrator and
          rebuilt lists included; program, libraries and Python are in the intercept

Each run is a process of the stock `lmp`, one rank; its deck stays under --work, to be profiled. A
second is one of the loop times the share of a core that it got. Styles take turns, ratios are
medians over rounds. The last line of output is one JSON object, as in the file beside --out.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import re
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from jamshape.initial import Mixture, random_packing
from jamshape.lammps_files import write_data
from jamshape.packing import Box, Packing
from jamshape.protocols import Compression, CompressionRun
from jamshape.session import Session, plugin_path
from jamshape.storage import read_packing, write_packing

LOADER = Path(__file__).resolve().parents[1] / "inputs" / "load_plugin.lmp"
ALPHA = {"rods": 4.0, "discs": 0.0}
SKIN, LARGEST_CONTACT = 0.3, 1.4
MEASURES = {  # and their neigh_modify
    "force": "delay 2000000000 every 1 check no",
    "step": "delay 0 every 1 check yes",
    "memory": "delay 0 every 5 check no",
}
CALIBRATION, MOST_STEPS = 200, 2000  # the most of `step` is 1 % of strain, 2 % of phi
TILES = (3, 4, 5, 6)
RATIOS = {"polygon": "speed over polygon (>= 10)", "wca": "cost over wca (<= 4)"}


class Style(NamedTuple):
    """A pair style and what it needs; `flow` moves its particles."""

    kind: str
    write: Callable[[Path, Packing], None]
    set_up: str
    pair: str
    flow: str
    skin: float = SKIN


def lines(*columns: Sequence[Any] | np.ndarray) -> str:
    """Rows of a data file, floats with all digits."""
    lists = [np.asarray(column).tolist() for column in columns]
    return "".join(" ".join(map(str, row)) + "\n" for row in zip(*lists, strict=True))


def write_other(path: Path, packing: Packing, *, rods: bool) -> None:
    """Write a data file for `atom_style body rounded/polygon 2 2` or, of discs, `atomic`."""
    one, A, (x, y) = np.ones(packing.n, int), packing.half_length, packing.axes.T
    zero, across, along = 0 * one, A**2 / 3, packing.radius**2 / 2
    inertia = [across * y * y + along * x * x, across * x * x + along * y * y, across]
    inertia += [(along - across) * x * y, zero, zero]
    ends = [A * x, A * y, zero, -A * x, -A * y, zero]
    numbers = lines(*inertia, *ends, 2 * packing.radius).splitlines()
    bodies = lines(packing.id, one, 13 * one, [f"\n2\n{row}" for row in numbers])
    flag_and_mass = [one, one] if rods else []
    atoms = lines(packing.id, packing.species, *flag_and_mass, *packing.position.T, zero)
    lo, hi = packing.box.lo, packing.box.lo + packing.box.edges
    box = lines([*lo, -0.5], [*hi, 0.5], ["xlo", "ylo", "zlo"], ["xhi", "yhi", "zhi"])
    head = f"benchmark\n\n{packing.n} atoms\n{packing.n * rods} bodies\n2 atom types\n{box}"
    masses = "" if rods else "Masses\n\n1 1\n2 1\n\n"
    rest = f"\nBodies\n\n{bodies}" if rods else ""
    path.write_text(f"{head}\n{masses}Atoms\n\n{atoms}{rest}")


def ours(sides: str) -> Style:
    """Make our style."""
    return Style(
        "rods",
        write_data,
        f"atom_style ellipsoid\ninclude {LOADER}",
        f"pair_style spherocylinder/harmonic sides {sides}\npair_coeff * * 1.0",
        "fix flow all overdamped/affine drag 1.0 compress 1e-4 integrator heun\ntimestep 0.05",
    )


CONTACTS = {"1 1": 1.0, "1 2": 1.2, "2 2": LARGEST_CONTACT}
WCA = "\n".join(f"pair_coeff {ij} 1 {d / 2 ** (1 / 6)} {d}" for ij, d in CONTACTS.items())
STYLES = {
    "ours-one": ours("one"),
    "ours-two": ours("two"),
    "polygon": Style(
        "rods",
        partial(write_other, rods=True),
        "atom_style body rounded/polygon 2 2\ncomm_modify vel yes",
        # No damping, friction or attraction, and no force that grows with the length of contact.
        "pair_style body/rounded/polygon 0 0 0 1e9 0\npair_coeff * * 1 0",
        "fix flow all nve/body\ntimestep 1e-6",
        # Its cutoff leaves the rounding radii out: the skin must hold them, or contacts are lost.
        SKIN + LARGEST_CONTACT,
    ),
    "wca": Style(
        "discs",
        partial(write_other, rods=False),
        "atom_style atomic",
        f"pair_style lj/cut {LARGEST_CONTACT}\n{WCA}",
        "fix flow all nve\ntimestep 1e-6",
    ),
}


def make_state(path: Path, kind: str, phi: float, n: int) -> None:
    """Compress a random packing; in a process of its own, for it starts MPI."""
    start = random_packing(n, 0.4, 1, Mixture.bidisperse(ALPHA[kind]))
    with Session() as session:
        run = CompressionRun(session, Compression(1e-3, phi, 0.1), start)
        with tqdm(total=run.last_step, desc=path.stem) as bar:
            for sample in run.samples(100):
                bar.update(sample.step - bar.n)
        write_packing(path, run.packing())


def state(work: Path, name: str, phi: float, n: int) -> Packing:
    """Return the compressed state for a style, made once."""
    path = work / f"{STYLES[name].kind}_{phi:g}_{n}.h5"
    if not path.exists():
        spawn = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(1, mp_context=spawn) as pool:
            pool.submit(make_state, path, STYLES[name].kind, phi, n).result()
    return read_packing(path)


def write_deck(path: Path, name: str, measure: str, packing: Packing) -> None:
    """Write a deck, which takes the variables `steps` and `tiles`, and its data file."""
    style, data = STYLES[name], path.with_suffix(".data")
    style.write(data, packing)
    path.write_text(
        f"units lj\ndimension 2\n{style.set_up}\nread_data {data}\n"
        + ("" if measure == "force" else style.flow)
        + ("\nreplicate ${tiles} ${tiles} 1" if measure == "memory" else "")
        + f"\n{style.pair}\nneighbor {style.skin} bin\nneigh_modify {MEASURES[measure]}\n"
        + 'thermo 0\nrun ${steps}\nshell "grep VmHWM /proc/$PPID/status"\n'
    )


def run_deck(path: Path, plugin: Path, steps: int, tiles: int = 1) -> dict[str, float]:
    """Run LAMMPS; returns what it and the kernel tell of the run."""
    variables = ["-var", "steps", str(steps), "-var", "tiles", str(tiles)]
    command = ["lmp", "-in", str(path), "-log", "none", "-nocite", *variables]
    environment = os.environ | {"JAMSHAPE_PLUGIN": str(plugin), "OMP_NUM_THREADS": "1"}
    lmp = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    loop = r"Loop time of (\S+) on 1 procs for (\d+) steps with (\d+) atoms"
    found = re.search(rf"{loop}.*?([\d.]+)% CPU.*VmHWM:\s+(\d+)", lmp.stdout, re.DOTALL)
    if lmp.returncode or not found:
        msg = f"'{' '.join(command)}' failed, its last words:\n{(lmp.stdout + lmp.stderr)[-999:]}"
        raise RuntimeError(msg)
    seconds, done, n, percent, peak = map(float, found.groups())
    rate = n * done / (seconds * percent / 100)
    return {"n": n, "rate": rate, "core share": percent / 100, "bytes": 1024 * peak}


def cases(options: argparse.Namespace, measure: str, phi: float, n: int) -> Cases:
    """Make what can be run on one state."""
    found = {}
    for name in options.only:
        is_ours = name.startswith("ours")
        if is_ours or measure != "step":
            deck = options.work / f"{name}_{measure}_{phi:g}_{n}.lmp"
            write_deck(deck, name, measure, state(options.work, name, phi, n))
            found[name] = partial(run_deck, deck, plugin_path())
        if is_ours and options.against:
            found[name + BEFORE] = partial(run_deck, deck, options.against)
    return found


def rates(options: argparse.Namespace, measure: str, phi: float, n: int) -> Iterator[Row]:
    """Time the styles in turn on one state."""
    found, steps = cases(options, measure, phi, n), {}
    for name, run in found.items():
        wanted = int(options.seconds * run(CALIBRATION)["rate"] / n) + 1
        steps[name] = min(wanted, MOST_STEPS) if measure == "step" else wanted
    runs: dict[str, list[dict[str, float]]] = {name: [] for name in found}
    for name in tqdm(list(found) * options.rounds, desc=f"{measure} {phi:g} {n}"):
        runs[name].append(found[name](steps[name]))
    speeds = {name: np.array([run["rate"] for run in runs[name]]) for name in found}
    for name, speed in speeds.items():
        row: Row = {"measure": measure, "phi": phi, "N": n, "style": name, "steps": steps[name]}
        row["core share"] = median(run["core share"] for run in runs[name])
        row["particle-steps/s"] = float(np.median(speed))
        for other, title in RATIOS.items() if name.startswith("ours") else ():
            against = speeds.get(name + other if other == BEFORE else other)
            if against is not None:
                ratio = against / speed if other == "wca" else speed / against
                row[title] = float(np.median(ratio))
        yield row


def memory(options: argparse.Namespace) -> Iterator[Row]:
    """Measure bytes a particle."""
    phi, n = options.phi[-1], options.n[0]
    for name, run in tqdm(cases(options, "memory", phi, n).items(), desc="memory"):
        runs = [run(20, tiles=k) for k in TILES]
        N, peak = [[run[key] for run in runs] for key in ("n", "bytes")]
        slope, start = np.polyfit(N, peak, 1)
        off = np.abs(slope * np.array(N) + start - peak).max() / (N[-1] - N[0])
        row = {"measure": "memory", "phi": phi, "N": f"{N[0]:.0f} to {N[-1]:.0f}", "style": name}
        yield row | {"bytes a particle (< 400)": float(slope), "+-": float(off)}


def markdown(rows: list[Row]) -> str:
    """Draw a table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [[row.get(name, "") for name in names] for row in rows]
    text = [[f"{c:.3g}" if isinstance(c, float) else str(c) for c in line] for line in cells]
    return "".join(f"| {' | '.join(line)} |\n" for line in [names, ["---"] * len(names), *text])


def about() -> dict[str, str]:
    """Machine, versions, date and command."""
    cpu = re.search(r"model name\s*:\s*(.+)", Path("/proc/cpuinfo").read_text())
    lmp = subprocess.run(["lmp", "-h"], capture_output=True, text=True, check=True).stdout
    version = re.search(r"Simulator - (.+)", lmp)
    return {
        "machine": f"{cpu[1] if cpu else platform.machine()}, {os.cpu_count()} cores",
        "LAMMPS": version[1] if version else "unknown",
        "date": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        "command": shlex.join(["python", *sys.argv]),
    }


def parse() -> argparse.Namespace:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="N = 1024 only")
    add("--only", nargs="+", choices=STYLES, default=list(STYLES), help="styles (all)")
    add("--measure", nargs="+", choices=MEASURES, default=list(MEASURES), help="(all)")
    add("--phi", nargs="+", type=float, default=[0.5, 0.86], help="packing fractions (0.5 0.86)")
    add("--n", nargs="+", type=int, default=[1024, 10000], help="particles (1024 10000)")
    add("--rounds", type=int, default=5, help="(5)")
    add("--seconds", type=float, default=1.5, help="of each run (1.5)")
    add("--against", type=Path, help="an older plugin to compare with")
    add("--work", type=Path, default=Path("runs/benchmark"), help="states, decks (runs/benchmark)")
    add("--out", type=Path, default=Path("runs/benchmark/pair.md"), help="(runs/benchmark/pair.md)")
    return parser.parse_args()


def main() -> None:
    """Measure, and write what was found."""
    options = parse()
    options.n = [1024] if options.quick else options.n
    options.work.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for measure in options.measure:
        ...
