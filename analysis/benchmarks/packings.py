"""Core seconds of packings by the usual way, how they end, phi_J and z, and how all that changes with N.

    python analysis/benchmarks/packings.py --seeds 3 --out runs/packing_times
    python analysis/benchmarks/packings.py --cases rods-1 rods-4 --n 64 256 1024 --seeds 8
    python analysis/benchmarks/packings.py --cases superballs --n 400 --seconds 300
    python analysis/benchmarks/packings.py --n 64 256 400 1000 1024 --seeds 20 --kept --out runs/packing_times

Each packing is one call of make_packing in a process of its own with one thread, which is given up after some
seconds; its seconds are those in which the processor was busy, from the call to the measured packing. What is
finished is kept, and taken from there the next time. A table tells of each case and size the median of the
seconds, the means of phi_J and z with their standard errors, how packings end, and in the last column whether
the contacts of those that are in equilibrium are as many as isostatic ones of round particles are, where they
are round. A second table tells for cases of several sizes as what power of N the median of the seconds grows, by a
straight line through the logarithms, and from each size to the next. With --kept nothing is made: the tables tell of
what is in the folder. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.files.disk import store

# By default as many as the tables of the papers and of other programs have.
CASES: dict[str, tuple[str, tuple[int, ...]]] = {
    "discs": ("js.Spherocylinders(alpha=0)", (256, 1024)),
    "rods-0.01": ("js.Spherocylinders(alpha=0.01)", (256,)),
    "rods-1": ("js.Spherocylinders(alpha=1)", (256, 1024)),
    "rods-4": ("js.Spherocylinders(alpha=4)", (256, 1024)),
    "spheres": ("js.Superellipsoids(p=1, w1=1, w2=1)", (400, 1000)),
    "spheroids": ("js.Superellipsoids(p=1, w1=0.6, w2=1)", (400,)),
    "superballs": ("js.Superellipsoids(p=1.5, w1=1, w2=1)", (400,)),
}
ROUND = ("discs", "spheres")

ONE = """
import json, sys, time
import jamshape as js
began = time.process_time()
found = js.make_packing({case}, n={n}, seed={seed}, progress=False).results
names = ("outcome", "residual", "phi_J", "z", "n_contacts", "n_rattlers", "evaluations")
told = {{name: found[name] for name in names}}
print(json.dumps(told | {{"seconds": time.process_time() - began}}))
"""


class Task(NamedTuple):
    """One packing."""

    case: str
    n: int
    seed: int


class Growth(NamedTuple):
    """Growth of the time of a case with N."""

    case: str
    n: list[int]
    seconds: list[float]
    power: float
    local: list[float]
    """From each size to the next."""

    def told(self) -> list[str]:
        """Make the line of a table."""
        sizes, seconds = ", ".join(map(str, self.n)), ", ".join(f"{s:.3g}" for s in self.seconds)
        return [
            self.case,
            sizes,
            seconds,
            f"{self.power:.2f}",
            ", ".join(f"{p:.1f}" for p in self.local),
        ]


def parser() -> ArgumentParser:
    """Make the parser."""
    found = parser_of(__doc__)
    add = found.add_argument
    add("--cases", nargs="*", default=list(CASES), choices=list(CASES), help="(all)")
    add("--n", type=int, nargs="*", help="particles (those of each case)")
    add("--seeds", type=int, default=3, help="packings of each (3)")
    add("--seconds", type=float, default=600.0, help="after which one is given up (600)")
    add("--kept", action="store_true", help="make nothing, tell of what is finished")
    add("--out", type=Path, default=Path("runs/packing_times"), help="folder for what is finished")
    return found


def main(options: Namespace) -> int:
    """Make what is missing and print the table."""
    options.out.mkdir(parents=True, exist_ok=True)
    rows = [made(task, options) for task in tasks(options) if is_asked_for(task, options)]
    table = [told(group) for group in grouped(rows)]
    print("| | N | core s, median (range) | phi_J | z | ends | isostatic |")
    print("| --- | --- | --- | --- | --- | --- | --- |")
    for line in table:
        print("| " + " | ".join(line) + " |")
    growing = growths(rows)
    print("\n| | N | core s, medians | power of N | between neighbours |")
    print("| --- | --- | --- | --- | --- |")
    for growth in growing:
        print("| " + " | ".join(growth.told()) + " |")
    report({"out": options.out, "rows": rows, "growths": growing})
    return 0


def tasks(options: Namespace) -> Iterator[Task]:
    """List all packings."""
    for case in options.cases:
        for n in options.n or CASES[case][1]:
            for seed in range(1, options.seeds + 1):
                yield Task(case, n, seed)


def file_of(task: Task, options: Namespace) -> Path:
    """Return the file of a finished task."""
    path: Path = options.out / f"{task.case}_n{task.n}_seed{task.seed}.json"
    return path


def is_asked_for(task: Task, options: Namespace) -> bool:
    """Whether a packing is to be in the tables."""
    return not options.kept or file_of(task, options).exists()


def made(task: Task, options: Namespace) -> dict[str, Any]:
    """Make a packing, unless it is there, and tell what it took."""
    path = file_of(task, options)
    if path.exists():
        kept: dict[str, Any] = json.loads(path.read_text())
        return kept
    code = ONE.format(case=CASES[task.case][0], n=task.n, seed=task.seed)
    found = task._asdict() | told_by(code, options.seconds)
    store(path, json.dumps(found).encode())
    print(f"{task.case} N {task.n} seed {task.seed}: {found['outcome']}, {found['seconds']:.1f} s",
          file=sys.stderr, flush=True)  # fmt: skip
    return found


def told_by(code: str, seconds: float) -> dict[str, Any]:
    """Run a piece of Python with one thread; what it prints, or how it ended."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
    command = [sys.executable, "-c", code]
    try:
        done = subprocess.run(
            command,
            capture_output=True,
            text=True,
            timeout=seconds,
            env=os.environ | threads,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return {"outcome": "not done", "seconds": seconds}
    if done.returncode:
        return {"outcome": "error", "seconds": 0.0, "error": done.stderr[-400:]}
    found: dict[str, Any] = json.loads(done.stdout)
    return found


def grouped(rows: list[dict[str, Any]]) -> Iterator[list[dict[str, Any]]]:
    """Put packings of one case and size together."""
    for key in dict.fromkeys((row["case"], row["n"]) for row in rows):
        yield [row for row in rows if (row["case"], row["n"]) == key]


def told(group: list[dict[str, Any]]) -> list[str]:
    """Make the line of a table."""
    seconds = [row["seconds"] for row in group]
    good = [row for row in group if "phi_J" in row]
    ends = Counter(row["outcome"] for row in group)
    first = group[0]
    return [
        first["case"],
        str(first["n"]),
        f"{np.median(seconds):.3g} ({min(seconds):.3g} to {max(seconds):.3g})",
        mean([row["phi_J"] for row in good], 4),
        mean([row["z"] for row in good], 3),
        ", ".join(f"{count} {name}" for name, count in ends.items()),
        isostatic(first["case"], good),
    ]


def growths(rows: list[dict[str, Any]]) -> list[Growth]:
    """Fit how the seconds of each case of several sizes grow with N; those given up count with what they had."""
    found = []
    for case in dict.fromkeys(row["case"] for row in rows):
        of_case = [group for group in grouped(rows) if group[0]["case"] == case]
        sizes = {g[0]["n"]: float(np.median([row["seconds"] for row in g])) for g in of_case}
        if len(sizes) > 1:
            n, seconds = sorted(sizes), [sizes[k] for k in sorted(sizes)]
            x, y = np.log(n), np.log(seconds)
            local = (np.diff(y) / np.diff(x)).tolist()
            found.append(Growth(case, n, seconds, float(np.polyfit(x, y, 1)[0]), local))
    return found


def mean(values: list[float], digits: int) -> str:
    """Give a mean with its standard error."""
    if len(values) < 2:
        return f"{values[0]:.{digits}f}" if values else ""
    error = np.std(values, ddof=1) / np.sqrt(len(values))
    return f"{np.mean(values):.{digits}f} +- {error:.{digits}f}"


def isostatic(case: str, good: list[dict[str, Any]]) -> str:
    """Count the packings of round particles with as many contacts as forces can be balanced by, and one more."""
    if case not in ROUND:
        return ""
    D = 2 if case == "discs" else 3
    exact = [r["n_contacts"] == D * (r["n"] - r["n_rattlers"]) - D + 1 for r in good]
    return f"{sum(exact)} of {len(exact)}"


if __name__ == "__main__":
    run(parser(), main)
