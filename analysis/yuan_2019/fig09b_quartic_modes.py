"""Draw contacts against quartic modes: Fig. 9 b and the inset of Fig. 11 b of Yuan, VanderWerf, Shattuck & O'Hern, Soft Matter (2019).

    python analysis/fig_quartic_modes.py SWEEP [MORE ...] --follow 3 --out quartic_modes.png

N_c of every packing against d_f (N - N_r) - N_q - 2, of d_f = 3 for spheres, 5 for spheroids and 6 for others, and
below how far it is from the unit line. N_q is the number of modes below the gap of the spectrum; --follow tests this,
in the first packing of each shape and protocol, along so many modes on both sides of the gap: those below must
have a crossover to a quartic energy, those above none. Spectra are kept in files. The last line of standard
output is one JSON object with a row for each packing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from superellipsoid_files import Groups, Kind, family_legend, mark, parser_of, read_groups
from superellipsoid_files import samples_text as text_of
from superellipsoid_modes import QuarticCount, followed, kept_modes, modes_option, quartic_count
from tqdm import tqdm

Counts = dict[Kind, list[QuarticCount]]


def draw(groups: Groups, counts: Counts, out: Path) -> None:
    """Draw all packings on the unit line, and their distance from it."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help and for errors

    figure = Figure(figsize=(5.6, 6), dpi=200, layout="constrained")
    top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[3, 1])
    for kind, found in counts.items():
        style: dict[str, Any] = mark(kind) | {"ls": "none", "ms": 6}
        x = [count.expected for count in found]
        top.plot(x, [count.n_contacts for count in found], **style)
        bottom.plot(x, [count.missing for count in found], **style)
    every = np.array([[c.expected, c.n_contacts] for found in counts.values() for c in found])
    ends = np.array([every.min(), every.max()]) + np.array([-1, 1]) * (0.05 * np.ptp(every) + 1)
    top.plot(ends, ends, "--", color="0.5", lw=1, zorder=0, label="unit line")
    bottom.axhline(0, color="0.5", ls="--", lw=1, zorder=0)
    top.set_ylabel("contacts $N_c$")
    bottom.set(xlabel=r"$d_f(N-N_r)-N_q-2$", ylabel="difference")
    largest = max(abs(bottom.get_ylim()[0]), abs(bottom.get_ylim()[1]), 3)
    bottom.set_ylim(-largest, largest)
    family_legend(top, groups, text_of(groups), loc="upper left")
    figure.savefig(out)


def main() -> None:
    """Read, count, draw, report."""
    parser = parser_of(__doc__, "quartic_modes.png")
    modes_option(parser)
    many = "modes followed on each side of the gap (%(default)s)"
    parser.add_argument("--follow", type=int, default=0, metavar="K", help=many)
    options = parser.parse_args()
    groups = read_groups(options.packings)
    counts: Counts = {kind: [] for kind in groups}
    found: list[dict[str, Any]] = []
    every = [(kind, sample) for kind, samples in groups.items() for sample in samples]
    for kind, sample in tqdm(every, unit="packing"):
        count = quartic_count(kept_modes(sample, options.modes))
        row = {"packing": str(sample.path), **kind.report(), **count._asdict()}
        row |= {"expected": count.expected, "on_line": count.missing == 0}
        if options.follow > 0 and not counts[kind]:
            row |= followed(sample, options.follow)
        counts[kind].append(count)
        found.append(row)
    draw(groups, counts, options.out)
    on_line = sum(row["on_line"] for row in found)
    total = {"packings": len(found), "on_line": on_line}
    print(json.dumps({"out": str(options.out), **total, "counts": found}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"fig_quartic_modes.py: {error}")
