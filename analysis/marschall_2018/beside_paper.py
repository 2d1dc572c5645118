"""Put the numbers of a run, a packing and its modes beside those of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/beside_paper.py --run SLOW.h5 --packing PACKING.h5 --modes MODES.h5

SLOW.h5 is of `jamshape slow` or `jamshape compress`, which minimise frames of it; PACKING.h5 of `jamshape pack` and
MODES.h5 of `jamshape modes`. Prints a table: each is one sample of its N, the paper's are averages over samples. The
last line of standard output is one JSON object with the same.
"""

from __future__ import annotations

import math
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.files.sets import PackingFile, System, of_paper
from jamshape.measures import published
from jamshape.measures.averages import Mean
from jamshape.measures.runs import read_run
from jamshape.vibration.sets import TOLD, key_of
from jamshape.vibration.table import read_modes

NONE = Mean(math.nan)


class Row(NamedTuple):
    """A line of the table."""

    quantity: str
    here: str
    paper: str = ""


def alpha_of(system: System) -> float:
    """Aspect ratio of rods such as the paper's; NaN of others."""
    return system.number("alpha") if of_paper(system) else math.nan


def rows_of_run(path: Path) -> tuple[int, list[Row]]:
    """Tell N, where the pressure begins, and where frames stay jammed."""
    one = read_run(path)
    known, kappa = published.PHI_J.get(alpha_of(one.ensemble.system), NONE), one.ensemble.kappa
    onset = Mean(*one.fit[:2]).text() if one.fit else "none"
    rows = [Row(f"phi_J(kappa = {kappa:g}), p to 0", onset, number(known))]
    if one.jamming:
        unjams, jams, _ = one.jamming
        rows.append(
            Row("phi_J between frames, minimised", f"{unjams:.5f} and {jams:.5f}", number(known))
        )
    return one.ensemble.n, rows


def rows_of_packing(path: Path) -> tuple[int, list[Row]]:
    """Tell N, phi_J, z and rattlers."""
    file = PackingFile.read(path)
    alpha, u0 = alpha_of(file.system()), file.number("u0")
    phi, phi_J, z, rattlers, n = map(file.number, ("phi", "phi_J", "z", "n_rattlers", "n"))
    distance = published.DISTANCE.get(alpha, {}).get(u0)
    few = published.RATTLERS.get(alpha)
    return int(n), [
        Row(
            f"phi_J of the packing, u0 = {u0:g} to 0",
            f"{phi_J:.5f}",
            number(published.PHI_J.get(alpha, NONE)),
        ),
        Row(
            f"phi - phi_J at u0 = {u0:g}",
            f"{phi - phi_J:.2g}",
            f"{distance:.2g}" if distance else "",
        ),
        Row("z", f"{z:.3f}", number(published.Z.get(alpha, NONE))),
        Row(
            "rattlers",
            f"{100 * rattlers / n:.2g} %",
            "" if few is None else f"{100 * few / published.N:.2g} %",
        ),
    ]


def rows_of_modes(path: Path) -> tuple[int, list[Row]]:
    """Tell N and the fractions of modes in the bands."""
    table = read_modes(path)
    known = published.BANDS.get(alpha_of(key_of(table).system), {})
    share = {band: len(table.in_band(band)) / int(table.attributes["n_modes"]) for band in TOLD}
    rows = [
        Row(f"modes in the {band} band", f"{part:.4f}", f"{known[band]:.4f}" if known else "")
        for band, part in share.items()
    ]
    return int(table.attributes["n"]), rows


def number(known: Mean) -> str:
    """Write a number of the paper with the digits that it has."""
    return (
        known.text()
        if math.isfinite(known.error)
        else f"{known.value:g}" * math.isfinite(known.value)
    )


def main(options: Namespace) -> None:
    """Read, print, report."""
    found = []
    for path, read in (
        (options.run, rows_of_run),
        (options.packing, rows_of_packing),
        (options.modes, rows_of_modes),
    ):
        found += [read(path)] if path else []
    if not found:
        msg = "no file was given, expected --run, --packing or --modes"
        raise ValueError(msg)
    sizes = dict.fromkeys(n for n, _ in found)
    rows = [row for _, of in found for row in of]
    title = Row("", f"here, N = {', '.join(map(str, sizes))}", f"the paper, N = {published.N}")
    widths = [max(len(row[k]) for row in (title, *rows)) for k in range(3)]
    for row in (title, *rows):
        print(
            "   "
            + "  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip()
        )
    report({"n": list(sizes), "rows": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__)
    for name, meaning in (
        ("run", "a compression"),
        ("packing", "a packing"),
        ("modes", "its modes"),
    ):
        parser.add_argument(f"--{name}", type=Path, metavar=f"{name.upper()}.h5", help=meaning)
    run(parser, main)
