"""Cost of our rods against LAMMPS's own rods and discs, on the same states, in one go.

    python analysis/benchmark_pair.py --quick
    python analysis/benchmark_pair.py --only ours-one --phi 0.86 --n 1024 --measure force
                                      --against AN_OLDER_jamshape_plugin.so

ours-one, ours-two: spherocylinder/harmonic; polygon: body/rounded/polygon with the same centres,
angles, spines and radii; wca: lj/cut discs with sigma = R_i + R_j at the same N and phi.

  force   `run M` without integrator: each step is one force evaluation on a kept neighbour list
  nve     the same under each atom style's fix nve, the list checked: LAMMPS's cost of any step
  step    the whole compression step, lists rebuilt as needed: two evaluations, box, drag, rotation
  memory  slope of the peak resident set against N (a state replicated 3 x 3 to 6 x 6), integrator
          and rebuilt lists included; program, libraries and Python are in the intercept

Each run is a process of the stock `lmp`, one rank; its deck stays under --work, to be profiled. A
second is one of the loop time, times the share of a core that it got. Styles take turns, ratios are
medians over rounds. Writes a table and JSON; the last line of output is that JSON object.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import time
from argparse import ArgumentParser, Namespace, RawTextHelpFormatter
from collections import namedtuple
from collections.abc import Callable
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import plugin_path
from jamshape.packing import Packing

Row = dict[str, Any]
Run = namedtuple("Run", "n peak_bytes rate core_share")
Style = namedtuple("Style", "states write set_up pair nve skin")

ROOT = Path(__file__).resolve().parents[1]
ALPHA, SKIN = {"rods": 4.0, "discs": 0.0}, 0.3
CONTACTS = {"1 1": 1.0, "1 2": 1.2, "2 2": 1.4}  # R_i + R_j of the types
CHECKED, KEPT = "delay 0 every 1 check yes", "delay 2000000000 every 1 check no"
MEASURES = {"force": KEPT, "nve": CHECKED, "step": CHECKED, "memory": "delay 0 every 5 check no"}
COMPRESSION = "fix flow all overdamped/affine drag 1 compress 1e-4 integrator heun\ntimestep 0.05\n"
CALIBRATION, MOST_STEPS = 200, 2000  # the most of `step` is 1 % of strain, 2 % of phi
FASTER, DEARER, LIGHT = "speed over polygon (>= 10)", "cost over wca (<= 4)", "bytes each (< 400)"


def write_other(path: Path, packing: Packing, *, rods: bool) -> None:
    """Write a data file for `atom_style body rounded/polygon 1 2` or, of discs, `atomic`."""
    write_data(path, packing)
    head, _, text = path.read_text().partition("Atoms # ellipsoid")
    atoms = text.partition("\nEllipsoids")[0]
    if rods:
        text = f"Atoms{atoms}\nBodies\n\n"
        ends, R = packing.half_length[:, None] * packing.axes, packing.radius
        for i, (x, y), diameter in zip(packing.id, ends.tolist(), (2 * R).tolist(), strict=True):
            text += f"{i} 1 13\n2\n1 1 2 0 0 0\n{x} {y} 0 {-x} {-y} 0 {diameter}\n"
    else:
        text = "Masses\n\n1 1\n2 1\n\nAtoms" + re.sub(r"(?m)^(\d+ \d) 1 1 ", r"\1 ", atoms)
    head = head.replace(f"{packing.n} ellipsoids", f"{packing.n} bodies" if rods else "")
    path.write_text(head + text)


STYLES = {
    f"ours-{sides}": Style(
        "rods",
        write_data,
        f"atom_style ellipsoid\ninclude {ROOT}/inputs/load_plugin.lmp",
        f"pair_style spherocylinder/harmonic sides {sides}\npair_coeff * * 1",
        "nve/asphere",
        SKIN,
    )
    for sides in ("one", "two")
}
STYLES["polygon"] = Style(
    "rods",
    partial(write_other, rods=True),
    # Two vertices each, but `2 2` crashes: a rod is smaller than its smallest chunk of memory.
    "atom_style body rounded/polygon 1 2\ncomm_modify vel yes",
    # No damping, friction or attraction, and no force that grows with the length of contact.
    "pair_style body/rounded/polygon 0 0 0 1e9 0\npair_coeff * * 1 0",
    "nve/body",
    SKIN + max(CONTACTS.values()),  # its cutoff leaves out the radii: contacts would be lost
)
STYLES["wca"] = Style(
    "discs",
    partial(write_other, rods=False),
    "atom_style atomic",
    "pair_style lj/cut 1\n"
    + "\n".join(f"pair_coeff {ij} 1 {d} {d * 2 ** (1 / 6)}" for ij, d in CONTACTS.items()),
    "nve",
    SKIN,
)


def state(work: Path, kind: str, phi: float, n: int) -> Packing:
    """Return a compressed state, made once, by a process of its own."""
    path = work / f"{kind}_{phi:g}_{n}.h5"
    if not (path.exists() and read_attributes(path).get("finished")):
        settings = f"--alpha {ALPHA[kind]} --n {n} --phi-end {phi} --kappa 1e-3 --dt 0.1 --frames 1"
        command = [sys.executable, f"{ROOT}/pyscripts/compress.py", *settings.split()]
        subprocess.run([*command, "--out", str(path)], check=True, stdout=subprocess.DEVNULL)
    return read_packing(path)


def write_deck(path: Path, style: Style, measure: str, packing: Packing) -> None:
    """Write a deck, which takes the variables `steps` and `tiles`, and its data file."""
    data, is_ours = path.with_suffix(".data"), style.write is write_data
    style.write(data, packing)
    nve = f"fix flow all {style.nve}\ntimestep 1e-6\n"
    flow = COMPRESSION if is_ours and measure != "nve" else nve
    path.write_text(
        f"units lj\ndimension 2\n{style.set_up}\nread_data {data}\n"
        + ("replicate ${tiles} ${tiles} 1\n" if measure == "memory" else "")
        + f"{style.pair}\nneighbor {style.skin} bin\nneigh_modify {MEASURES[measure]}\n"
        + (flow if measure != "force" else "")
        + 'thermo 0\nrun ${steps}\nshell "grep VmHWM /proc/$PPID/status"\n'
    )


def run_deck(path: Path, plugin: Path, steps: int, tiles: int = 1) -> Run:
    """Run LAMMPS; returns what it and the kernel tell."""
    variables = ["-var", "steps", str(steps), "-var", "tiles", str(tiles)]
    command = ["lmp", "-in", str(path), "-log", "none", "-nocite", *variables]
    environment = os.environ | {"JAMSHAPE_PLUGIN": str(plugin), "OMP_NUM_THREADS": "1"}
    lmp = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    loop = r"Loop time of (\S+) on 1 procs for (\d+) steps with (\d+) atoms.*?([\d.]+)% CPU"
    found, peak = re.search(loop, lmp.stdout, re.DOTALL), re.search(r"VmHWM:\s+(\d+)", lmp.stdout)
    if lmp.returncode or not found or not peak:
        msg = f"'{' '.join(command)}' failed, its last words:\n{(lmp.stdout + lmp.stderr)[-999:]}"
        raise RuntimeError(msg)
    seconds, done, n, percent = map(float, found.groups())
    return Run(n, 1024 * int(peak[1]), n * done / (seconds * percent / 100), percent / 100)


def cases(options: Namespace, measure: str, phi: float, n: int) -> dict[str, Callable[..., Run]]:
    """Make what can be run on one state."""
    found: dict[str, Callable[..., Run]] = {}
    for name in options.only:
        is_ours, style = name.startswith("ours"), STYLES[name]
        if is_ours or measure != "step":
            deck = options.work / f"{name}_{measure}_{phi:g}_{n}.lmp"
            write_deck(deck, style, measure, state(options.work, style.states, phi, n))
            found[name] = partial(run_deck, deck, plugin_path())
            if is_ours and options.against:
                found[f"{name} before"] = partial(run_deck, deck, options.against)
    return found


def rates(options: Namespace, measure: str, phi: float, n: int) -> list[Row]:
    """Time the styles in turn on one state."""
    runs, steps = cases(options, measure, phi, n), {}
    for name, run in runs.items():
        wanted = int(options.seconds * run(CALIBRATION).rate / n) + 1
        steps[name] = min(wanted, MOST_STEPS) if measure == "step" else wanted
    turns = tqdm(list(runs) * options.rounds, desc=f"{measure} {phi:g} {n}")
    found = [(name, runs[name](steps[name])) for name in turns]
    rate = {name: np.array([run.rate for who, run in found if who == name]) for name in runs}
    rows: list[Row] = []
    for name in runs:
        row = {"measure": measure, "phi": phi, "N": n, "style": name, "steps": steps[name]}
        row["core share"] = np.median([run.core_share for who, run in found if who == name])
        row["particle-steps/s"] = np.median(rate[name])
        if "polygon" in rate:
            row[FASTER] = np.median(rate[name] / rate["polygon"])
        if "wca" in rate:
            row[DEARER] = np.median(rate["wca"] / rate[name])
        if f"{name} before" in rate:
            row["speed over before"] = np.median(rate[name] / rate[f"{name} before"])
        rows.append(row)
    return rows


def memory(options: Namespace, phi: float, n: int) -> list[Row]:
    """Fit bytes a particle; `+-` is the largest distance from the line over the range of N."""
    rows = []
    for name, run in tqdm(cases(options, "memory", phi, n).items(), desc="memory"):
        N, peak = np.array([run(20, tiles=k)[:2] for k in range(3, 7)]).T
        line = np.polyfit(N, peak, 1)
        off = np.abs(np.polyval(line, N) - peak).max() / np.ptp(N)
        row = {"measure": "memory", "phi": phi, "N": f"{N[0]:.0f} to {N[-1]:.0f}", "style": name}
        rows.append(row | {LIGHT: line[0], "+-": off})
    return rows


def markdown(rows: list[Row]) -> str:
    """Draw a table."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    cells = [[row.get(name, "") for name in names] for row in rows]
    text = [[f"{c:.3g}" if isinstance(c, float) else str(c) for c in line] for line in cells]
    return "".join(f"| {' | '.join(line)} |\n" for line in [names, ["---"] * len(names), *text])


def about() -> Row:
    """Machine, version, date and command."""
    cpu = re.search(r"model name\s*: (.+)", Path("/proc/cpuinfo").read_text())
    text = subprocess.run(["lmp", "-h"], capture_output=True, text=True, check=True).stdout
    version, date = re.search(r"Simulator - (.+)", text), time.strftime("%Y-%m-%d %H:%M %z")
    found = {"machine": cpu and cpu[1], "LAMMPS": version and version[1], "date": date}
    return found | {"command": " ".join(["python", *sys.argv])}


def parse() -> Namespace:
    """Command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawTextHelpFormatter)
    add, work = parser.add_argument, Path("runs/benchmark")
    add("--quick", action="store_true", help="N = 1024 only")
    add("--only", nargs="+", choices=STYLES, default=list(STYLES), help="styles (all)")
    add("--measure", nargs="+", choices=MEASURES, default=list(MEASURES), help="(all)")
    add("--phi", nargs="+", type=float, default=[0.5, 0.86], help="packing fractions (0.5 0.86)")
    add("--n", nargs="+", type=int, default=[1024, 10000], help="particles (1024 10000)")
    add("--rounds", type=int, default=5, help="(5)")
    add("--seconds", type=float, default=1.5, help="of each run (1.5)")
    add("--against", type=Path, help="an older plugin to compare with")
    add("--work", type=Path, default=work, help="folder of states and decks (runs/benchmark)")
    add("--out", type=Path, default=work / "pair.md", help="table (runs/benchmark/pair.md)")
    return parser.parse_args()


def publish(out: Path, rows: list[Row]) -> None:
    """Write the table and the numbers, and print both."""
    head = "".join(f"{key}: {value}  \n" for key, value in about().items())
    numbers = json.dumps(about() | {"rows": rows}) + "\n"
    out.write_text(f"{head}\n{markdown(rows)}")
    out.with_suffix(".json").write_text(numbers)
    print(out.read_text(), numbers, sep="\n", end="")


def main() -> None:
    """Measure, and write what was found."""
    options = parse()
    for folder in (options.work, options.out.parent):
        folder.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    sizes = [1024] if options.quick else options.n
    for phi, n, measure in product(options.phi, sizes, options.measure):
        rows += rates(options, measure, phi, n) if measure != "memory" else []
    if "memory" in options.measure:
        rows += memory(options, options.phi[-1], 1024)
    publish(options.out, rows)


if __name__ == "__main__":
    main()
