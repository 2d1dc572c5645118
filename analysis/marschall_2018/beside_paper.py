"""Put the numbers of a run, a packing and its modes beside those of Marschall & Teitel, PRE 97, 012905.

    python analysis/marschall_2018/beside_paper.py --run SLOW.h5 --packing PACKING.h5 [MORE.h5 ...] --modes MODES.h5 [MORE.h5 ...]

SLOW.h5 is of `jamshape slow` or `jamshape compress`, which minimise frames of it; PACKING.h5 of `jamshape pack` and
MODES.h5 of `jamshape modes`. Prints a table with averages over samples and their standard errors. The last line of
standard output is one JSON object with the same.
"""

from __future__ import annotations

import math
import sys
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from jamshape.command import parser_of, report, run
from jamshape.files.ensembles import System
from jamshape.measures.averages import Mean
from jamshape.measures.runs import read_run
from jamshape.vibration.ensembles import TOLD

sys.path.insert(0, str(Path(__file__).parents[1]))
from common import published
from common.averages import mean, mean_over
from common.ensembles import n_of, of_paper, read_groups
from common.mode_tables import fraction_of, read_tables

NONE = Mean(math.nan)


class Row(NamedTuple):
    """A line of the table."""

    quantity: str
    samples: int
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
    rows = [Row(f"phi_J(kappa = {kappa:g}), p to 0", 1, onset, number(known))]
    if one.jamming:
        between = f"{one.jamming.unjams:.5f} and {one.jamming.jams:.5f}"
        rows.append(Row("phi_J between frames, minimised", 1, between, number(known)))
    return one.ensemble.n, rows


def rows_of_packings(paths: list[Path]) -> tuple[int, list[Row]]:
    """Tell N, phi_J, z and rattlers."""
    groups = read_groups(paths, same=("n", "size_ratio", "u0"))
    (system, files), *others = groups.items()
    if others:
        msg = f"{files[0].path} and {others[0][1][0].path} are of different particles, expected samples"
        raise ValueError(msg)
    alpha, u0, n = alpha_of(system), files[0].number("u0"), n_of(groups)
    phi_J, z, bearing, rattlers = (
        mean_over(files, [file.number(name) for file in files])
        for name in ("phi_J", "z", "z_bearing", "n_rattlers")
    )
    beyond = mean([file.number("phi") - file.number("phi_J") for file in files]).value
    distance = published.DISTANCE.get(alpha, {}).get(u0)
    few = published.RATTLERS.get(alpha)
    here = (
        (f"phi_J, u0 = {u0:g} to 0", phi_J.text(), number(published.PHI_J.get(alpha, NONE))),
        (f"phi - phi_J at u0 = {u0:g}", f"{beyond:.2g}", f"{distance:.2g}" if distance else ""),
        ("z of all bonds", z.text(), ""),
        ("z of bonds above 1e-6 of the mean", bearing.text(), number(published.Z.get(alpha, NONE))),
        ("rattlers", percent(rattlers.value, n), "" if few is None else percent(few, published.N)),
    )
    return n, [Row(name, len(files), *numbers) for name, *numbers in here]


def rows_of_modes(paths: list[Path]) -> tuple[int, list[Row]]:
    """Tell N, the fractions of modes in the bands, and that of sliding modes without grazing bonds, each of which stops one."""
    ((key, tables),) = read_tables(paths).items()
    known = published.BANDS.get(alpha_of(key.system), {})
    rows = []
    for band in TOLD:
        share = mean([fraction_of(t, band) for t in tables])
        paper = f"{known[band]:.4f}" if known else ""
        rows.append(Row(f"modes in the {band} band", len(tables), share.text(), paper))
    whole = [t for t in tables if "n_grazing" in t.attributes]
    stopped = [t.attributes["n_grazing"] / t.n_vibrational for t in whole]
    low = mean([fraction_of(t, "low") + n for t, n in zip(whole, stopped, strict=True)])
    paper = f"{known['low']:.4f}" if known else ""
    rows.append(Row("low band without bonds below 1e-6", len(whole), low.text(), paper))
    return int(tables[0].attributes["n"]), rows


def percent(part: float, whole: int) -> str:
    """Write a part of the particles."""
    return f"{100 * part / whole:.2g} %"


def number(known: Mean) -> str:
    """Write a number of the paper with the digits that it has."""
    if math.isfinite(known.error):
        return known.text()
    return f"{known.value:g}" if math.isfinite(known.value) else ""


def show(title: Sequence[str], rows: Sequence[Row]) -> None:
    """Print the table."""
    lines = [tuple(title), *(tuple(map(str, row)) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        cells = (text.ljust(width) for text, width in zip(line, widths, strict=True))
        print(f"   {'  '.join(cells)}".rstrip())


def main(options: Namespace) -> None:
    """Read, print, report."""
    found = []
    found += [rows_of_run(options.run)] if options.run else []
    found += [rows_of_packings(options.packing)] if options.packing else []
    found += [rows_of_modes(options.modes)] if options.modes else []
    if not found:
        msg = "no file was given, expected --run, --packing or --modes"
        raise ValueError(msg)
    sizes = list(dict.fromkeys(n for n, _ in found))
    rows = [row for _, of in found for row in of]
    here = f"here, N = {', '.join(map(str, sizes))}"
    show(("", "samples", here, f"the paper, N = {published.N}"), rows)
    report({"n": sizes, "rows": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__)
    parser.add_argument("--run", type=Path, metavar="RUN.h5", help="a compression")
    several: dict[str, Any] = {"type": Path, "nargs": "+", "default": []}
    parser.add_argument("--packing", metavar="PACKING.h5", help="samples", **several)
    parser.add_argument("--modes", metavar="MODES.h5", help="their modes", **several)
    run(parser, main)
