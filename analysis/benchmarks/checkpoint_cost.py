"""Cost of checkpoints: the fraction of a run that is spent on writing its file.

    python analysis/benchmarks/checkpoint_cost.py --cases rows frames short

- rows: a shear of 256 rods in LAMMPS with 2000 rows;
- frames: a compression of 100000 discs in LAMMPS with 20 frames;
- short: an implicit shear of 64 rods that takes about ten seconds.

Fractions are those of the seconds between the first write of the file, at the start, and the last one, at the end: that
of checkpoints between these two, and that of all writes. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import sys
import tempfile
import time
from argparse import Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

import jamshape as js
from jamshape.command import parser_of, report, run
from jamshape.files.content import Content


def rows(file: Path) -> None:
    """Shear 256 rods."""
    rods = js.Spherocylinders(alpha=4)
    js.shear(rods, n=256, phi=0.8, gdot=1e-3, strain=8.0, rows=2000, file=file)


def frames(file: Path) -> None:
    """Compress 100000 discs."""
    discs = js.Spherocylinders(alpha=0)
    js.compress(discs, n=100_000, phi=(0.4, 0.41), kappa=1e-4, rows=200, frames=20, file=file)


def short(file: Path) -> None:
    """Shear 64 rods slowly."""
    rods = js.Spherocylinders(alpha=4)
    js.shear(rods, n=64, phi=0.85, gdot=1e-7, strain=0.2, rows=100, file=file)


CASES: dict[str, Callable[[Path], None]] = {"rows": rows, "frames": frames, "short": short}


def measured(case: Callable[[Path], None], folder: Path) -> dict[str, Any]:
    """Record a run; return the seconds of its writes, and of the run between the first and the last."""
    spans: list[tuple[float, float]] = []
    write = Content.write

    def timed(*args: Any) -> None:
        began = time.perf_counter()
        write(*args)
        spans.append((began, time.perf_counter()))

    Content.write = timed  # type: ignore[method-assign, assignment]
    try:
        case(folder / "run.h5")
    finally:
        Content.write = write  # type: ignore[method-assign]
    total, each = spans[-1][1] - spans[0][0], [end - began for began, end in spans]
    found = {"seconds": total, "writes": len(spans), "bytes": (folder / "run.h5").stat().st_size}
    return found | {"checkpoints": sum(each[1:-1]) / total, "all": sum(each) / total}


def main(options: Namespace) -> None:
    """Measure the cases."""
    found = {}
    for name in options.cases:
        with tempfile.TemporaryDirectory() as folder:
            found[name] = measured(CASES[name], Path(folder))
        print(f"{name}: {found[name]}", file=sys.stderr)
    report(found)


if __name__ == "__main__":
    parser = parser_of(__doc__)
    parser.add_argument("--cases", nargs="+", choices=CASES, default=list(CASES))
    run(parser, main)
