"""Every stiff and extreme case, with what is expected of it and what is measured: the stability battery.

    python analysis/stability/stability_report.py --out runs/stability
    python analysis/stability/stability_report.py --only "restart|coincident" --out runs/stability

Writes report.md: a table of case, part, expected behaviour, measured error or sentence, verdict and seconds. A run
that was killed goes on where it was when started again; --only takes a regular expression of the names of cases
(part: name), --again repeats what is there, --quick leaves out what takes many seconds. The last line of standard
output is one JSON object; the exit code is 0 only if every verdict holds.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import platform
import re
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import cache
from pathlib import Path
from typing import Any

from tqdm import tqdm

from jamshape.command import parser_of, report, run
from jamshape.files.disk import store

sys.path.insert(0, str(Path(__file__).parents[1]))

from battery.case import Case, Verdict
from battery.cases import all_cases


def parser() -> argparse.ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/stability")
    found.add_argument("--only", default="", help="regular expression of names of cases")
    found.add_argument("--quick", action="store_true", help="without cases of many seconds")
    found.add_argument("--again", action="store_true", help="repeat what is there")
    return found


@cache
def _cases() -> dict[str, Case]:
    return {case.label: case for case in all_cases()}


def _quietly(log: str) -> None:
    """Send what LAMMPS says to a file, in the process that runs the cases."""
    os.dup2(os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND), 2)


def _judged(label: str) -> Verdict:
    began = time.perf_counter()
    try:
        return _cases()[label].judge()
    except Exception as error:  # noqa: BLE001 - any failure is a verdict
        return Verdict(f"{type(error).__name__}: {error}", False, time.perf_counter() - began)


def verdicts(labels: list[str], log: Path) -> Iterator[Verdict]:
    """Run cases one by one, in a process that an error of LAMMPS may end."""
    context = multiprocessing.get_context("spawn")

    def process() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(1, context, _quietly, (str(log),))

    pool = process()
    for label in labels:
        began = time.perf_counter()
        try:
            yield pool.submit(_judged, label).result()
        except BrokenProcessPool:
            said = [x for x in log.read_text().splitlines() if x.startswith("ERROR")]
            words = f"the process ended: {said[-1] if said else 'no sentence'}"
            yield Verdict(words, False, time.perf_counter() - began)
            pool = process()
    pool.shutdown()


def shown(value: float | str) -> str:
    """Show a number or a sentence, for a cell of a table."""
    text = value if isinstance(value, str) else f"{value:.2g}"
    return text.replace("|", "\\|").replace("\n", " ")


def table(records: dict[str, dict[str, Any]], labels: list[str]) -> list[str]:
    """Rows of Markdown."""
    lines = [
        "| case | part | error or sentence of | expected | measured | verdict | s |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for label in labels:
        case, found = _cases()[label], records[label]
        sign = "" if isinstance(case.expected, str) else "<= "
        verdict = "holds" if found["holds"] else "**FAIL**"
        cells = [case.name, case.part, case.measure, sign + shown(case.expected)]
        cells += [shown(found["measured"]), verdict, f"{found['seconds']:.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def page(records: dict[str, dict[str, Any]]) -> str:
    """Write all that was judged, what fails first."""
    labels = [label for label in _cases() if label in records]
    failed = [label for label in labels if not records[label]["holds"]]
    seconds = sum(records[label]["seconds"] for label in labels)
    lines = [
        "# Stability battery",
        "",
        f"{len(labels)} cases, {len(failed)} of which fail, in {seconds:.0f} s.",
        "",
        f"{platform.platform()}, Python {platform.python_version()}.",
        "",
    ]
    if failed:
        lines += ["## Fails", "", *table(records, failed), ""]
    for part in dict.fromkeys(_cases()[label].part for label in labels):
        own = [label for label in labels if _cases()[label].part == part]
        lines += [f"## {part[0].upper()}{part[1:]}", "", *table(records, own), ""]
    return "\n".join(lines)


def asked(options: argparse.Namespace) -> list[str]:
    """List the names of the cases that are asked for.

    Raises
    ------
    ValueError
        If there is none.
    """
    try:
        wanted = re.compile(options.only)
    except re.error as error:
        msg = f"--only {options.only!r} is no pattern ({error}), expected a regular expression"
        raise ValueError(msg) from None
    found = [
        label
        for label, case in _cases().items()
        if wanted.search(label) and not (options.quick and case.heavy)
    ]
    if not found:
        msg = f"no case is called {options.only!r}, expected part of a name such as 'own images'"
        raise ValueError(msg)
    return found


def main(options: argparse.Namespace) -> int:
    """Run what is asked for and not there; return the exit code."""
    labels = asked(options)
    options.out.mkdir(parents=True, exist_ok=True)
    path, out = options.out / "verdicts.json", options.out / "report.md"
    records: dict[str, dict[str, Any]] = json.loads(path.read_text()) if path.exists() else {}
    # What failed is looked at again: it may have been mended.
    todo = [x for x in labels if options.again or not records.get(x, {}).get("holds")]
    found = verdicts(todo, options.out / "lammps.log")
    for label, verdict in zip(todo, tqdm(found, total=len(todo), unit="case"), strict=True):
        records[label] = verdict._asdict()
        store(path, json.dumps(records, indent=1).encode())
        out.write_text(page({x: records[x] for x in labels if x in records}))
    out.write_text(page({label: records[label] for label in labels}))
    failed = [label for label in labels if not records[label]["holds"]]
    seconds = sum(records[label]["seconds"] for label in labels)
    report({"out": out, "cases": len(labels), "failed": failed, "seconds": seconds})
    return 1 if failed else 0


if __name__ == "__main__":
    run(parser(), main)
