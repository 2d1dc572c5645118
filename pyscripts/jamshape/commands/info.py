"""Describe a file: a packing, a run, modes, a data, dump or restart file of LAMMPS, or a GSD file.

    jamshape info packing.h5

Reports the particles, how they were made and how accurate the result is, whether it is finished, and how to
continue if not. The last line of standard output is one JSON object.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from jamshape.command import parser_of, report
from jamshape.commands.contents import contents_of
from jamshape.files.meaning import Wanted
from jamshape.shapes.command_line import add_meaning_options
from jamshape.shapes.shape import law_text, stiffness_text

# Lines of the output; each part is printed if its number is known.
_LINES = {
    "particles": ("{n} {shape}s in {dimension}D", "{kinds_text}"),
    "contacts": ("law {law_text}", "k_e {k_e_text}"),
    "box": ("{box_text}", "tilt {tilt_text}"),
    "state": (
        "phi {phi:.8g}",
        "pressure {pressure:.4g}",
        "u {u:.4g}",
        "z {z:.5g}",
        "z_single {z_single:.5g}",
        "z_bearing {z_bearing:.5g} (bonds above 1e-6 of the mean force)",
        "z_iso {z_iso:.5g}",
        "{rattlers} rattlers",
    ),
    "order": ("S_2 {S_2:.4g}", "S_4 {S_4:.4g}", "C_4 {C_4:.4g}"),
    "made with": (
        "seed {seed}",
        "kappa {kappa:g}",
        "u0 {u0:g}",
        "pressure {target_pressure:g}",
        "phi {target_phi:g}",
        "box {box_yields}",
        "stable to shear at try {tries}",
        "protocol {protocol}",
        "phi from {phi_start:g}",
        "to {phi_end:g}",
        "{flow} shear at gdot {gdot:g}",
        "{flow} shear to strains of +-{amplitude:g}",
        "{cycles} cycles of the period {period:g}",
        "steps of {strain_step:g}",
        "to strain {strain_end:g}",
        "at pressure {hold_pressure:g}",
        "where the box relaxes in {box_time:.3g}",
        "and packings in about {relaxation_time:.3g}",
    ),
    "last cycle": (
        "number {last_cycle[number]}",
        "work {last_cycle[work]:.4g}",
        "lost {last_cycle[lost]:.4g}",
        "storage modulus {last_cycle[storage]:.4g}",
        "loss modulus {last_cycle[loss]:.4g}",
        "{returned_text}",
    ),
    "modes": ("{modes} of {n_modes}", "{bands_text}", "by the method {method!r}"),
    "moduli": ("bulk {bulk_modulus:.6g}", "mean shear {B_G_dc:.6g}", "{stability_text}"),
    "holds": (
        "{frames} frames",
        "{samples} samples",
        "{rows} rows of error and time",
        "step {step}",
        "time {time:.6g}",
    ),
    "error": ("{error_of} {error:.2g}",),
    "took": ("{wall_seconds:.3g} s",),
    "written by": ("LAMMPS of {lammps}", "jamshape {jamshape_version}", "format {format_version}"),
    "not reached": ("{shortfall}",),
    "made on": ("{origin}",),
    "continue with": ("{go_on}",),
}

_NET_FORCE = "largest net force over the mean bond force:"
_ERRORS = {"packing": _NET_FORCE, "modes": _NET_FORCE}


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    parser.add_argument("file", type=Path, metavar="FILE", help="any file of jamshape or LAMMPS")
    add_meaning_options(parser)
    return parser


def main(options: Namespace) -> None:
    """Read, print, report."""
    found = contents_of(options.file, Wanted(options.dimension, options.shape))
    print(f"{options.file}: {_title(found)}")
    for line in lines_of(found):
        print(f"  {line}")
    report(found)


def lines_of(found: Mapping[str, Any]) -> Iterator[str]:
    """Yield a line for each known subject."""
    known = {name: value for name, value in found.items() if value is not None}
    known["error_of"] = _ERRORS.get(found["kind"], "of the last step:")
    known |= {
        f"{name}_text": sign.join(f"{length:.6g}" for length in found[name])
        for name, sign in (("box", " x "), ("tilt", " "))
        if name in found
    }
    if found.get("k_e", 1.0) != 1.0:
        known["k_e_text"] = stiffness_text(found["k_e"])
    if "power" in found:
        known["law_text"] = law_text(found["power"])
    if found.get("kinds"):
        known["kinds_text"] = "; ".join(_kind(kind, found["unit"]) for kind in found["kinds"])
    if "bands" in found:
        counts = {name: count for name, count in found["bands"].items() if count is not None}
        told = ", ".join(f"{count} {name}" for name, count in counts.items())
        known["bands_text"] = told or "no bands"
    if "is_stable_to_shear" in known:
        known["stability_text"] = (
            f"{'stable' if found['is_stable_to_shear'] else 'unstable'} to shear"
        )
    if "last_cycle" in found:
        known["returned_text"] = _returned(found["last_cycle"])
    for subject, parts in _LINES.items():
        said = [text for text in (_filled(part, known) for part in parts) if text]
        if said:
            yield f"{subject + ':':12} {', '.join(said)}"


def _returned(cycle: Mapping[str, Any]) -> str:
    """Describe whether particles return."""
    if cycle["is_reversible"] is None:
        return "without its states"
    word = "reversible" if cycle["is_reversible"] else "not reversible"
    return f"{word}: particles within {cycle['largest']:.2g} radii, {cycle['changed']} contacts changed"


def _filled(part: str, known: Mapping[str, Any]) -> str:
    try:
        return part.format_map(known)
    except KeyError:  # unknown
        return ""


def _title(found: Mapping[str, Any]) -> str:
    state = "" if found["finished"] else ", not finished"
    return f"{found['kind']}{', ' * ('outcome' in found)}{found.get('outcome', state)}"


def _kind(kind: Mapping[str, Any], unit: str) -> str:
    numbers = [
        f"{name} {value:.4g}" for name, value in kind.items() if name not in {"size", "count"}
    ]
    return f"{kind['count']} with {', '.join(numbers)}, {unit} = {kind['size']:.4g}"
