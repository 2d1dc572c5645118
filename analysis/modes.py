"""Find the modes of a packing: Sec. III D of Marschall & Teitel, PRE 97, 012905.

    python analysis/modes.py PACKING.h5 --out modes.h5

Eigenvalues of the dynamical matrix with signs and error bounds, bands and their counts, participation,
kinds of motion and elastic moduli, to HDF5 (see jamshape.vibration.table). PACKING is H5MD as make_packing.py
writes it. Needs no LAMMPS. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.vibration.hessian import Scope, dynamical_matrix
from jamshape.vibration.sparse_modes import lowest, near
from jamshape.vibration.spectrum import METHODS, Spectrum, spectrum
from jamshape.vibration.statistics import density_of_states, mean_in_bins, redundancies
from jamshape.vibration.table import BANDS, ModeTable, tabulate, write_modes

SHOWN = 12  # modes of the printed table
KINDS = {"rotation": "o", "parallel": "s", "perpendicular": "D"}


def parse() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("packing", type=Path, metavar="PACKING.h5")
    parser.add_argument("--out", type=Path, default=Path("modes.h5"), help="(%(default)s)")
    parser.add_argument("--plot", type=Path, help="D(omega), participation and kinds of motion")
    parser.add_argument("--method", choices=[*METHODS, "sparse"], default="projected")
    parser.add_argument("--lowest", type=int, metavar="K", help="only the K softest, sparse")
    parser.add_argument("--near", type=float, metavar="OMEGA", help="K modes near it instead")
    parser.add_argument(
        "--rotation", choices=["half_length", "radius"], default="half_length",
        help="what a radian counts for (%(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--least-force", type=float, default=0.0, metavar="X",
        help="leave out contacts weaker than X mean bond forces; 1e-4 leaves out those that only graze",
    )  # fmt: skip
    parser.add_argument("--vectors", action="store_true", help="store the modes themselves")
    parser.add_argument("--force", action="store_true", help="also where the state is no minimum")
    return parser.parse_args()


def plain(value: Any) -> Any:
    """Turn numbers into those of JSON, NaN and infinity into null."""
    value = value.item() if isinstance(value, np.generic) else value
    return None if isinstance(value, float) and not math.isfinite(value) else value


def summary_of(table: ModeTable) -> dict[str, Any]:
    """Count the bands and average their frequencies; unstable modes are counted, not averaged."""
    found: dict[str, Any] = {}
    for name in ("low", "middle", "high"):
        rows = table.in_band(name)
        omega, sign = table["omega"][rows], table["sign"][rows]
        found[name] = {
            "modes": len(rows),
            "fraction": len(rows) / table.attributes["n_modes"],
            "negative": int((sign < 0).sum()),
            "unsure": int((sign == 0).sum()),
            "mean_omega": plain(omega[omega > 0].mean()) if (omega > 0).any() else None,
            **{kind: plain(table[kind][rows].mean()) if len(rows) else None for kind in KINDS},
        }
    return found


def show(table: ModeTable, bands: dict[str, Any]) -> None:
    """Print counts, bands and the lowest modes."""
    a = table.attributes
    print(
        f"{a['n_backbone']} of {a['n']} particles, {a['n_modes']} coordinates, {a['n_bonds']} bonds"
    )
    print(
        f"z = {a['z']:.4f}, residual {a['residual']:.2g}; {a['method']}, {a['wall_seconds']:.3g} s"
    )
    if "rank" in a:
        print(
            f"rank of H {a['rank']} = N_c - {a['n_self_stress']}; N z / 2 = {a['high_expected']:g}"
        )
        print(f"modes below: {a['n_floppy']} and {a['n_translations']} translations;", end=" ")
        print(f"N (z_iso - z) / 2 = {a['low_expected']:g}; {a['n_grazing']} bonds only graze")
        print("band      modes  fraction  negative  unsure  mean omega")
        for name, b in bands.items():
            omega = math.nan if b["mean_omega"] is None else b["mean_omega"]
            row = f"{name:8} {b['modes']:6} {b['fraction']:9.5f} {b['negative']:9} {b['unsure']:7}"
            print(f"{row} {omega:11.4g}")
    print("lambda          sign  bound     of state  P       par.   perp.  rot.   band")
    for k in np.flatnonzero(~table["is_translation"])[:SHOWN]:
        kinds = " ".join(f"{table[n][k]:6.3f}" for n in ("parallel", "perpendicular", "rotation"))
        errors = f"{table.bound[k]:.2e}  {table['state_error'][k]:.2e}"
        start = f"{table['eigenvalues'][k]:14.6e} {table['sign'][k]:4d}  {errors}"
        print(f"{start}  {table['participation'][k]:.4f} {kinds}  {BANDS[table['band'][k]]}")
    keys = ("bulk_modulus", "pure_shear_modulus", "simple_shear_modulus", "pressure")
    print(", ".join(f"{key.replace('_', ' ')} {a[key]:.5g}" for key in keys))


def draw(table: ModeTable, out: Path) -> None:
    """Draw the density of states, the participation ratio and the kinds of motion."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed without --plot

    omega = table["omega"]
    bins = density_of_states(omega[~table["is_translation"]])
    figure = Figure(figsize=(6, 8), dpi=150, layout="constrained")
    top, middle, bottom = figure.subplots(3, 1, sharex=True)
    filled = bins.n_modes > 0
    top.loglog(bins.omega[filled], bins.density[filled], "o", mfc="none")
    top.set_ylabel(r"$D(\omega)$")
    middle.loglog(
        bins.omega, mean_in_bins(table["participation"], omega, bins.edges), "o", mfc="none"
    )
    middle.set_ylabel(r"$P(\omega)$")
    for kind, marker in KINDS.items():
        values = mean_in_bins(table[kind], omega, bins.edges)
        bottom.semilogx(bins.omega, values, marker, mfc="none", label=kind)
    bottom.set_ylabel("share of the motion")
    bottom.set_xlabel(r"$\omega$")
    bottom.legend()
    figure.savefig(out)


def main(options: argparse.Namespace) -> None:
    """Read, assemble, solve, write, report."""
    packing = read_packing(options.packing)
    landscape, state = Landscape(packing), State.of(packing)
    scope = Scope(options.rotation, options.least_force, force=options.force)
    matrix = dynamical_matrix(landscape, state, scope)
    found: Spectrum
    if options.method != "sparse" and not options.lowest:
        found = spectrum(matrix, options.method)
    elif options.near is None:
        found = lowest(matrix, options.lowest or 20)
    else:
        found = near(matrix, options.lowest or 20, options.near**2)
    table = tabulate(landscape, state, matrix, found)
    of_packing = {f"packing_{k}": v for k, v in read_attributes(options.packing).items()}
    asked = {"rotation": options.rotation, "least_force": options.least_force}
    write_modes(options.out, table, of_packing | asked, vectors=options.vectors)
    bands = summary_of(table)
    show(table, bands)
    extra = table.attributes.get("n_self_stress", 1) > 1
    sets = [r._asdict() for r in redundancies(matrix)] if extra else []
    for r in sets:
        ids = packing.id[r["particles"]].tolist()
        print(f"redundant bonds among particles {ids}: {r['n_states']} more states of self stress")
    if options.plot:
        draw(table, options.plot)
    report: dict[str, Any] = {"out": str(options.out), "bands": bands}
    report |= {k: plain(v) for k, v in table.attributes.items()}
    report["redundant"] = [[int(packing.id[p]) for p in r["particles"]] for r in sets]
    print(json.dumps(report))


if __name__ == "__main__":
    try:
        main(parse())
    except (OSError, ValueError) as error:
        sys.exit(f"modes.py: {error}")
