"""Time of an ensemble of small packings in Python, with imports, on all cores, with one kill on the way.

    python analysis/benchmarks/ensembles.py --n 32 64 --samples 1000

The ensemble is killed after a third of the time that it takes, estimated from its progress, and called again. The time is
that of both processes together. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from argparse import Namespace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.command import parser_of, report, run
from jamshape.front.ensemble_file import EnsembleFile
from jamshape.recording.workers import cores

_CALL = """
import jamshape as js
js.ensemble(js.Spherocylinders(alpha=0), n={n}, u0={u0}, seeds=range({samples}), file={file!r}, progress=False)
"""
_POLL = 0.05


def measured(n: int, u0: float, samples: int, folder: Path) -> dict[str, Any]:
    """Make an ensemble with a kill when a third is in its file; return its numbers and times."""
    file = folder / f"{n}.h5"
    call = [sys.executable, "-c", _CALL.format(n=n, u0=u0, samples=samples, file=str(file))]
    began = time.perf_counter()
    with subprocess.Popen(call) as first:
        while first.poll() is None and (not file.exists() or len(EnsembleFile(file)) < samples / 3):
            time.sleep(_POLL)
        first.kill()
    killed = time.perf_counter() - began
    kept = len(EnsembleFile(file))
    subprocess.run(call, check=True)
    seconds = time.perf_counter() - began
    table = EnsembleFile(file)
    assert np.array_equal(table["seed"], np.arange(samples))
    return {
        "n": n, "u0": u0, "samples": samples, "cores": cores(), "wall_seconds": seconds,
        "killed_after": killed, "rows_kept": kept, "reached": int(table["reached"].sum()),
        "seconds_in_packings": float(np.nansum(table["wall_seconds"])),
    }  # fmt: skip


def main(options: Namespace) -> None:
    """Measure and report."""
    with tempfile.TemporaryDirectory() as folder:
        rows = [measured(n, options.u0, options.samples, Path(folder)) for n in options.n]
    for row in rows:
        print(f"N = {row['n']}: {row['samples']} packings in {row['wall_seconds']:.1f} s")
    report({"ensembles": rows})


if __name__ == "__main__":
    parser = parser_of(__doc__)
    parser.add_argument("--n", type=int, nargs="+", default=[32, 64])
    parser.add_argument("--u0", type=float, default=1e-15)
    parser.add_argument("--samples", type=int, default=1000)
    run(parser, main)
