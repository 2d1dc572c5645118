"""Cost of superellipsoid/harmonic against LAMMPS's gayberne and resquared, on the same states, in one go.

    python analysis/benchmark_superellipsoid.py --quick

States are those of our particles, p = 1 or 2 and semi-axes 1, 1, w, minimised at a packing fraction
just above jamming; gayberne and resquared take the same centres, orientations and axes, and a cutoff
of the longest diameter, so that no contact is out of reach.

  kept    `run M` without integrator: each step is one force evaluation on a kept list; the contact
          solver finds every contact where it was
  moving  particles fly on straight lines, about 1e-3 a step, lists rebuilt as needed
  memory  slope of the peak resident set against N (a state replicated 2 x 2 x 2 to 4 x 4 x 4), for
          ours fix overdamped/affine included, for the others, whose forces here are no contact
          forces, nothing that moves particles

Each run is a process of the stock `lmp`, one rank. A second is one of the loop time, times the share
of a core that it got. Styles take turns, ratios are medians over rounds. Writes a table and JSON; the
last line of output is that JSON object.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, RawTextHelpFormatter
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from benchmark_pair import Row, publish, run_deck
from tqdm import tqdm

from jamshape.lammps.session import Session, plugin_path

ROOT = Path(__file__).resolve().parents[1]
SKIN, CALIBRATION = 0.3, 20
DENSITIES = {1.0: 0.70, 2.0: 0.72}  # packing fractions by p
CHECKED, KEPT = "delay 0 every 1 check yes", "delay 2000000000 every 1 check no"
MEASURES = {"kept": KEPT, "moving": CHECKED, "memory": CHECKED}
FASTER, BYTES = "speed over gayberne", "bytes each"


class Style(NamedTuple):
    """How a pair style is set up; {p} and {reach} stand for exponent and longest diameter."""

    pair: str
    flow: str


SET_UP = f"units lj\natom_style ellipsoid\ninclude {ROOT}/inputs/load_plugin.lmp\n"
NOTHING_MOVES = "fix flow all nve/noforce\n"
STYLES = {
    "ours": Style(
        "pair_style superellipsoid/harmonic\npair_coeff * * 1 {p}",
        "fix flow all overdamped/affine drag 1 compress 1e-6\ntimestep 0.1\n",
    ),
    "gayberne": Style(
        "pair_style gayberne 1 1 1 {reach}\npair_coeff * * 1 2 1 1 1 1 1 1", NOTHING_MOVES
    ),
    "resquared": Style(
        "pair_style resquared {reach}\npair_coeff * * 1 1 1 1 1 1 1 1", NOTHING_MOVES
    ),
}


def state(work: Path, p: float, w: float, n: int) -> Path:
    """Minimise a random state, once; returns its data file."""
    path = work / f"p{p:g}_w{w:g}_{n}.data"
    if path.exists():
        return path
    half = 0.5 * (8 * w * n) ** (1 / 3)
    with Session() as session:
        session.commands(f"""
            units lj
            atom_style ellipsoid
            region box block -{half} {half} -{half} {half} -{half} {half}
            create_box 1 box
            create_atoms 1 random {n} 1 NULL
            set type 1 shape 2 2 {2 * w}
            set type 1 quat/random 1
            {STYLES["ours"].pair.format(p=p)}
            neighbor {SKIN} bin
            neigh_modify one 10000 page 1000000
            compute packing all packing
            thermo_style custom step c_packing[1]
            run 0""")
        scale = (session.lmp.extract_compute("packing", 0, 1)[0] / DENSITIES[p]) ** (1 / 3)
        session.commands(f"""
            change_box all x scale {scale} y scale {scale} z scale {scale} remap
            min_style cg
            minimize 0 1e-9 400 4000
            write_data {path} nocoeff""")
    return path


def write_deck(path: Path, name: str, measure: str, data: Path, **values: float) -> None:
    """Write a deck, which takes the variables `steps` and `tiles`."""
    style = STYLES[name]
    flight = "velocity all create 1 1\nfix flow all nve/noforce\n"
    flow = {"kept": "", "moving": f"{flight}timestep 1.5e-3\n", "memory": style.flow}[measure]
    path.write_text(
        f"{SET_UP}read_data {data}\n"
        + ("replicate ${tiles} ${tiles} ${tiles}\n" if measure == "memory" else "")
        + f"{style.pair.format(**values)}\nneighbor {SKIN} bin\nneigh_modify {MEASURES[measure]}\n"
        + flow
        + 'thermo 0\nrun ${steps}\nshell "grep VmHWM /proc/$PPID/status"\n'
    )


def decks(options: Namespace, measure: str, p: float, w: float) -> dict[str, Path]:
    """Write the decks of all styles on one state."""
    data = state(options.work, p, w, options.n)
    found = {}
    for name in STYLES:
        found[name] = options.work / f"{name}_{measure}_p{p:g}_w{w:g}.lmp"
        write_deck(found[name], name, measure, data, p=p, reach=2 * max(w, 1))
    return found


def rates(options: Namespace, measure: str, p: float, w: float) -> list[Row]:
    """Time the styles in turn on one state."""
    plugin, found = plugin_path(), decks(options, measure, p, w)
    steps = {}
    for name, deck in found.items():
        wanted = int(options.seconds * run_deck(deck, plugin, CALIBRATION).rate / options.n) + 1
        steps[name] = min(wanted, 200) if measure == "moving" else wanted
    turns = tqdm(list(found) * options.rounds, desc=f"{measure} p {p:g} w {w:g}")
    runs = [(name, run_deck(found[name], plugin, steps[name])) for name in turns]
    rate = {name: np.array([run.rate for who, run in runs if who == name]) for name in found}
    return [
        {"measure": measure, "p": p, "w": w, "N": options.n, "style": name, "steps": steps[name],
         "core share": np.median([run.core_share for who, run in runs if who == name]),
         "particle-steps/s": np.median(rate[name]),
         FASTER: np.median(rate[name] / rate["gayberne"])}
        for name in found
    ]  # fmt: skip


def memory(options: Namespace, p: float, w: float) -> list[Row]:
    """Fit bytes a particle; `+-` is the largest distance from the line over the range of N."""
    rows = []
    for name, deck in tqdm(decks(options, "memory", p, w).items(), desc="memory"):
        runs = [run_deck(deck, plugin_path(), 3, tiles=k) for k in (2, 3, 4)]
        N, peak = np.array([run[:2] for run in runs]).T
        line = np.polyfit(N, peak, 1)
        off = np.abs(np.polyval(line, N) - peak).max() / np.ptp(N)
        row = {"measure": "memory", "p": p, "w": w, "N": f"{N[0]:.0f} to {N[-1]:.0f}"}
        rows.append({**row, "style": name, BYTES: line[0], "+-": off})
    return rows


def parse() -> Namespace:
    """Read the command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawTextHelpFormatter)
    add, work = parser.add_argument, Path("runs/benchmark")
    add("--quick", action="store_true", help="one aspect ratio, short runs: under a minute")
    add("--measure", nargs="+", choices=MEASURES, default=list(MEASURES), help="(all)")
    add("--p", nargs="+", type=float, choices=DENSITIES, default=list(DENSITIES), help="(1 2)")
    add("--w", nargs="+", type=float, default=[1.5, 3.0], help="aspect ratios (1.5 3)")
    add("--n", type=int, default=1000, help="particles (1000)")
    add("--rounds", type=int, default=5, help="(5)")
    add("--seconds", type=float, default=1.0, help="of each run (1)")
    add("--work", type=Path, default=work, help="folder of states and decks (runs/benchmark)")
    add("--out", type=Path, default=work / "superellipsoid.md",
        help="table (runs/benchmark/superellipsoid.md)")  # fmt: skip
    options = parser.parse_args()
    if options.quick:
        options.w, options.n, options.rounds, options.seconds = [1.5], 500, 3, 0.3
    return options


def main() -> None:
    """Measure, and write what was found."""
    options = parse()
    for folder in (options.work, options.out.parent):
        folder.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []
    for measure, p, w in product(options.measure, options.p, options.w):
        if measure != "memory":
            rows += rates(options, measure, p, w)
    if "memory" in options.measure:
        for p in options.p:
            rows += memory(options, p, options.w[0])
    publish(options.out, rows)


if __name__ == "__main__":
    main()
