"""Error of Heun's method against run time: the time step from 1e-3 to the stability limit.

    python analysis/heun_error.py --out runs/heun_error

One state of N = 256 rods (alpha = 4) just below jamming is compressed at kappa = 1e-4 through jamming
with each time step; errors are against a run with a far smaller one. Writes a table (Markdown), a
picture and the numbers (JSON); finished runs are kept and not repeated. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing

KAPPA = 1e-4
PHI_START, PHI_FROM, PHI_TO = 0.4, 0.84, 0.88
INTERVAL = 6.0  # time between samples, a multiple of every time step below
STEPS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.75, 1.0)
REFERENCE = 0.00025


def start_state(folder: Path, n: int) -> Packing:
    """Make the state that every run starts from, once."""
    path = folder / f"start_{n}.h5"
    if not path.exists():
        packing = random_packing(n, PHI_START, 1, Mixture.bidisperse(4.0))
        with Session() as session:
            run = CompressionRun(session, Compression(KAPPA, PHI_FROM), packing)
            run.advance(run.last_step)
            write_packing(path, run.packing())
    return read_packing(path)


def run_with(start: Packing, dt: float, sides: int) -> dict[str, Any]:
    """Pressures at the sample times, the end state, the cost and the stability limit met."""
    every = round(INTERVAL / dt)
    pressures, limits = [], []
    with Session() as session:
        run = CompressionRun(session, Compression(KAPPA, PHI_TO, dt, sides), start)
        began = time.perf_counter()
        for k in range(1, round(run.last_step * dt / INTERVAL) + 1):
            run.advance(k * every)
            sample = run.measure()
            pressures.append(sample["p"])
            limits.append(sample["dt_max"])
        wall = time.perf_counter() - began
        return {
            "dt": dt, "sides": sides, "wall_seconds": wall, "p": pressures,
            "evaluations": sample["evaluations"], "dt_limit": min(limits),
            "overlap": sample["overlap"], "position": run.packing().position.tolist(),
        }  # fmt: skip


def kept(folder: Path, start: Packing, dt: float, sides: int) -> dict[str, Any] | None:
    """Return the run of before, or make it in a process of its own; None if the fix refused it."""
    path = folder / f"sides{sides}_dt{dt:g}_n{start.n}.json"
    if not path.exists():
        from subprocess import run  # noqa: PLC0415 - Debian's LAMMPS ends the process on an error

        command = [sys.executable, __file__, "--one", str(dt), str(sides), "--n", str(start.n)]
        finished = run(
            [*command, "--out", str(folder)], capture_output=True, text=True, check=False
        )
        if finished.returncode:
            return None
        path.write_text(finished.stdout.splitlines()[-1])
    return dict(json.loads(path.read_text()))


def errors(run: dict[str, Any], reference: dict[str, Any]) -> dict[str, float]:
    """Relative errors of the pressure, and of positions over the largest overlap."""
    p, exact = np.array(run["p"]), np.array(reference["p"])
    relative = np.abs(p - exact)[exact > 0] / exact[exact > 0]
    moved = np.array(run["position"]) - np.array(reference["position"])
    moved -= np.median(moved, axis=0)
    size = float(np.median(np.linalg.norm(moved, axis=1)))
    return {
        "dt": run["dt"],
        "sides": run["sides"],
        "evaluations": run["evaluations"],
        "wall_seconds": run["wall_seconds"],
        "p_median": float(np.median(relative)),
        "p_largest": float(relative.max()),
        "position": size / reference["overlap"],
        "dt_limit": run["dt_limit"],
    }


def table(rows: list[dict[str, float]], refused: list[tuple[float, int]]) -> str:
    """Write the rows as Markdown."""
    lines = [
        "| sides | dt | evaluations | seconds | p: median error | p: largest error | positions |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {('one', 'two')[int(r['sides']) - 1]} | {r['dt']:g} | {r['evaluations']:.3g} | "
        f"{r['wall_seconds']:.2g} | {r['p_median']:.1e} | {r['p_largest']:.1e} | {r['position']:.1e} |"
        for r in rows
    ]
    lines += [f"| {('one', 'two')[sides - 1]} | {dt:g} | refused: past the stability limit |||||"
              for dt, sides in refused]  # fmt: skip
    return "\n".join(lines) + "\n"


def draw(rows: list[dict[str, float]], path: Path) -> None:
    """Errors against wall time."""
    import matplotlib as mpl  # noqa: PLC0415 - plotting only where a picture is made

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(1, 2, figsize=(9, 4), sharey=True, layout="constrained")
    for sides, axis in zip((1, 2), axes, strict=True):
        of = [r for r in rows if r["sides"] == sides]
        wall = [r["wall_seconds"] for r in of]
        axis.loglog(wall, [r["p_median"] for r in of], "o-", label="pressure, median")
        axis.loglog(wall, [r["p_largest"] for r in of], "s--", label="pressure, largest")
        for r in of:
            if r["dt"] not in (0.001, 0.01, 0.1, 0.6):
                continue
            axis.annotate(f"dt = {r['dt']:g}", (r["wall_seconds"], r["p_median"]), fontsize=7,
                          textcoords="offset points", xytext=(-4, -14), ha="right")  # fmt: skip
        axis.set(xlabel="run time (s)", title=f"sides {('one', 'two')[sides - 1]}")
        axis.grid(visible=True, alpha=0.3)
    axes[0].set_ylabel("relative error of p")
    axes[1].legend(loc="center right")
    figure.savefig(path, dpi=150)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("runs/heun_error"))
    parser.add_argument("--n", type=int, default=256)
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    start = start_state(options.out, options.n)
    if options.one:
        print(json.dumps(run_with(start, float(options.one[0]), int(options.one[1]))))
        return
    rows, refused = [], []
    for sides in (1, 2):
        reference = kept(options.out, start, REFERENCE, sides)
        assert reference is not None
        for dt in tqdm(STEPS, desc=f"sides {sides}", unit="run"):
            run = kept(options.out, start, dt, sides)
            if run is None:
                refused.append((dt, sides))
            else:
                rows.append(errors(run, reference))
    text = table(rows, refused)
    (options.out / "heun_error.md").write_text(text)
    draw(rows, options.out / "heun_error.png")
    print(text)
    limit = min(r["dt_limit"] for r in rows)
    curves = []
    for sides, name in ((1, "one"), (2, "two")):
        of = [r for r in rows if r["sides"] == sides]
        curves += [{"name": f"sides {name}", "seconds": [r["wall_seconds"] for r in of],
                    "error": [r["p_median"] for r in of]}]  # fmt: skip
    found = {"out": str(options.out), "dt_limit": limit, "refused": refused, "curves": curves}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
