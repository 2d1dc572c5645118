"""Compute the vibrational modes of a packing: Sec. III D of Marschall & Teitel, PRE 97, 012905.

    jamshape modes PACKING.h5 --out modes.h5

Eigenvalues of the dynamical matrix with signs and error bounds, bands and their counts, participation,
kinds of motion, elastic moduli and stability to shear, to HDF5 (see jamshape.vibration.table). PACKING is any file with particles at rest: of
`jamshape pack` or `jamshape minimise`, a LAMMPS dump or data file, GSD. Needs no LAMMPS, and
cannot be interrupted and resumed. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import math
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.checks import require_other_file
from jamshape.command import report
from jamshape.commands.signatures import called, parser_for
from jamshape.drawing.modes import mode_figure
from jamshape.drawing.saving import require_picture, save_figure
from jamshape.drawing.text import packing_text
from jamshape.files.ensembles import PackingFile
from jamshape.front.modes import Modes, modes, require_modes_file
from jamshape.vibration.ensembles import TOLD
from jamshape.vibration.statistics import Redundancy, redundancies
from jamshape.vibration.table import BANDS, MODULI, ModeTable
from jamshape.vibration.tensors import Modulus

SHOWN = 12  # modes of the printed table
STABLE = {True: "yes", False: "no", None: "undecided"}
KINDS = ("rotation", "parallel", "perpendicular")


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_for(modes, __doc__)
    out = Path("modes.h5")
    parser.add_argument("--out", type=Path, default=out, help="HDF5 file to write (%(default)s)")
    parser.add_argument("--plot", type=Path, help="D(omega), participation and kinds of motion")
    parser.add_argument("--vectors", action="store_true", help="store eigenvectors")
    return parser


def summary_of(table: ModeTable) -> dict[str, Any]:
    """Count the bands and average their frequencies, over definitely stable modes.

    None for bands that do not separate.
    """
    found: dict[str, Any] = dict.fromkeys(TOLD)
    for name in filter(table.has_band, TOLD):
        rows = table.in_band(name)
        omega, sign = table["omega"][rows], table["sign"][rows]
        found[name] = {
            "modes": len(rows),
            "fraction": len(rows) / max(table.n_vibrational, 1),
            "negative": int((sign < 0).sum()),
            "unsure": int((sign == 0).sum()),
            "mean_omega": omega[sign > 0].mean() if (sign > 0).any() else None,
            **{kind: table[kind][rows].mean() if len(rows) else None for kind in KINDS},
        }
    return found


def show(table: ModeTable, bands: dict[str, Any]) -> None:
    """Print counts, bands and the lowest modes."""
    a = table.attributes
    counted = f"{a['n_modes']} coordinates, {a['n_bonds']} bonds"
    print(f"{a['n_backbone']} of {a['n']} particles, {counted}")
    print(
        f"z = {a['z']:.4f}, residual {a['residual']:.2g}; {a['method']}, {a['wall_seconds']:.3g} s"
    )
    if table.imbalance:
        print(table.imbalance)
    if "rank" in a:
        show_bands(table, bands)
    if "why_no_bands" in a:
        print(a["why_no_bands"])
    print("lambda          sign  bound     of state  P       par.   perp.  rot.   band")
    for k in np.flatnonzero(~table["is_translation"])[:SHOWN]:
        kinds = " ".join(f"{table[n][k]:6.3f}" for n in ("parallel", "perpendicular", "rotation"))
        errors = f"{table.bound[k]:.2e}  {table['state_error'][k]:.2e}"
        start = f"{table['eigenvalues'][k]:14.6e} {table['sign'][k]:4d}  {errors}"
        print(f"{start}  {table['participation'][k]:.4f} {kinds}  {BANDS[table['band'][k]]}")
    show_moduli(table)


def show_moduli(table: ModeTable) -> None:
    """Print moduli with their bounds."""
    found = table.moduli
    if found.n_floppy:
        print(f"floppy modes, omitted from moduli: {found.n_floppy}")
    if found.n_unsettled:
        print(f"unsettled modes, also omitted: {found.n_unsettled}")
    if found.n_negative and not table.imbalance:
        print(
            f"a saddle, with {found.n_negative} negative eigenvalues: moduli hold as long as it stays"
        )
    for name in MODULI:
        print(f"{name.replace('_', ' ')} modulus {_text(getattr(found, name))}")
    print(f"mean shear modulus {_text(found.B.G_dc)}")
    for name, direction in (("G_min", "smallest"), ("G_max", "largest")):
        print(f"{direction} shear modulus of all directions {_text(getattr(found.B, name))}")
    print(f"pressure {found.pressure:.8g}")
    own = found.bordered
    print(
        f"stable to shear: {STABLE[found.is_stable_to_shear]}; smallest eigenvalue of the bordered Hessian"
        f" {own.value:.6g} +- {own.bound:.2g}"
    )


def _text(modulus: Modulus) -> str:
    """Write a modulus with its bound and reason."""
    bound = f" +- {modulus.bound:.2g}" if math.isfinite(modulus.bound) else ""
    value = f"{modulus.relaxed:.8g}{bound}" if math.isfinite(modulus.relaxed) else "not defined"
    return f"{value}: {modulus.reason}" if modulus.reason else value


def show_bands(table: ModeTable, bands: dict[str, Any]) -> None:
    """Print the counts of a whole spectrum, with expected ones; fractions are of all modes but translations."""
    a = table.attributes
    print(f"rank of H {a['rank']} = N_c - {a['n_self_stress']}; N z / 2 = {a['high_expected']:g}")
    print(
        f"modes below the high band: {a['n_floppy']}, plus {a['n_translations']} translations;",
        end=" ",
    )
    print(f"N (z_iso - z) / 2 = {a['low_expected']:g}; grazing bonds: {a['n_grazing']}")
    print("band      modes  fraction  negative  unsure  mean omega")
    for name, b in bands.items():
        if b is None:
            continue
        omega = math.nan if b["mean_omega"] is None else b["mean_omega"]
        row = f"{name:8} {b['modes']:6} {b['fraction']:9.5f} {b['negative']:9} {b['unsure']:7}"
        print(f"{row} {omega:11.4g}")


def tell_redundant(sets: list[Redundancy], ids: Any) -> list[list[int]]:
    """Print redundant bonds; return the IDs of their particles."""
    found = [[int(ids[p]) for p in one.particles] for one in sets]
    for one, own in zip(sets, found, strict=True):
        print(
            f"redundant bonds among particles {own}: {one.n_states} further states of self stress"
        )
    return found


def main(options: Namespace) -> None:
    """Find, write, report."""
    require_modes_file(options.out, [options.packing])
    if options.plot:
        require_other_file(options.plot, [options.packing, options.out])
        require_picture(options.plot)
    found: Modes = called(modes, options)
    table, packing, matrix = found.table, found.packing, found.matrix
    assert packing is not None
    assert matrix is not None
    found.save(options.out, vectors=options.vectors)
    bands = summary_of(table)
    show(table, bands)
    extra = table.attributes.get("n_self_stress", 1) > 1
    redundant = tell_redundant(redundancies(matrix) if extra else [], packing.id)
    if options.plot:
        file = PackingFile(
            options.packing, dict(packing.results), (packing.shape_style, packing.dimension)
        )
        save_figure(mode_figure(found.told, packing_text(file)), options.plot)
    told = {
        "out": options.out,
        "at_minimum": not table.imbalance,
        "bands": bands,
        **table.attributes,
        "is_stable_to_shear": table.moduli.is_stable_to_shear,
    }
    report(told | {"redundant": redundant})
