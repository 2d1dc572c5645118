"""What LAMMPS features were tried beside ours: works, by a number, or refused, by a sentence.

    python analysis/stability/lammps_features.py --out runs/lammps_features.md
    python analysis/stability/lammps_features.py --only "respa|setforce" --out runs/lammps_features.md

Each feature is a deck that a process of its own runs. Writes the table of docs/results/stability.md. The last line of
standard output is one JSON object; the exit code is 0 only if every feature gave the number or the sentence that
it must.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable

from features.contacts import CONTACTS
from features.feature import Feature, Outcome, judge
from features.moving import MOVING
from tqdm import tqdm

from jamshape.command import parser_of, report, run

FEATURES: tuple[Feature, ...] = (*MOVING, *CONTACTS)


def parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/lammps_features.md")
    found.add_argument("--only", default="", help="regular expression of names of features")
    return found


def line_of(feature: Feature, outcome: Outcome) -> str:
    """Write one row of the table."""
    word = "works" if outcome.works else "refused"
    cells = (feature.name, word if outcome.holds else f"**{word}**", outcome.found)
    return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"


def table(outcomes: Iterable[tuple[Feature, Outcome]]) -> str:
    """Write the table."""
    rows = [line_of(feature, outcome) for feature, outcome in outcomes]
    return "\n".join(["| feature | outcome | what decides |", "| --- | --- | --- |", *rows, ""])


def main(options: argparse.Namespace) -> int:
    """Run what is asked for; return the exit code."""
    asked = [one for one in FEATURES if re.search(options.only, one.name)]
    if not asked:
        msg = f"--only {options.only!r} found no feature, expected part of a name such as 'respa'"
        raise ValueError(msg)
    outcomes = [(one, judge(one)) for one in tqdm(asked, unit="feature")]
    options.out.parent.mkdir(parents=True, exist_ok=True)
    options.out.write_text(table(outcomes))
    failed = [one.name for one, outcome in outcomes if not outcome.holds]
    report({"out": options.out, "features": len(asked), "failed": failed})
    return 1 if failed else 0


if __name__ == "__main__":
    run(parser(), main)
