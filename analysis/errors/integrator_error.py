"""Error against cost of the integrators of `fix overdamped/affine`, at slow rates through jamming.

    python analysis/integrator_error.py --out runs/integrator_error

Rods (alpha = 4) and nearly round ones (alpha = 0.01), `sides two`, are compressed from a little below
jamming to beyond it with each integrator and tolerance; errors of the pressure are against a run with
a tolerance of 1e-7 (1e-6 for alpha = 0.01 at kappa = 1e-6, where one particle that rests on a kink of
the energy takes most of the steps: 1e-7 does not end in minutes). Heun's method with dt = 0.01 is run for a short stretch, and its cost
extrapolated. Writes a table (Markdown), a picture and the numbers (JSON); finished runs are kept and
not repeated. Seconds are of the processor. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing

PHI_START, KAPPA_START = 0.4, 1e-4
PHI = {4.0: (0.84, 0.88), 0.01: (0.83, 0.86)}  # from and to, under alpha
ROWS = 40
REFERENCE = ("rkc2", 1e-7)
LOOSER = {(0.01, 1e-6): 1e-6}  # tolerance of the reference, under alpha and kappa
METHODS = (
    ("heun/adaptive", 1e-3), ("heun/adaptive", 1e-4),
    ("rkc2", 1e-3), ("rkc2", 1e-4), ("rkc2", 1e-5),
)  # fmt: skip
HEUN_DT, HEUN_STEPS = 0.01, 4000


@dataclass(frozen=True)
class Case:
    """One compression, which all methods repeat."""

    n: int
    alpha: float
    kappa: float

    @property
    def name(self) -> str:
        """For files."""
        return f"n{self.n}_alpha{self.alpha:g}_kappa{self.kappa:g}"

    def settings(self, method: str, tolerance: float) -> Compression:
        """Return what the run is told."""
        phi_from, phi_to = PHI[self.alpha]
        told = Compression(self.kappa, phi_to, sides=2, integrator=method, tolerance=tolerance)
        return told.in_steps(phi_from, ROWS)


def start_state(folder: Path, case: Case) -> Packing:
    """Make the state that every run starts from, once."""
    path = folder / f"start_n{case.n}_alpha{case.alpha:g}.h5"
    if not path.exists():
        packing = random_packing(case.n, PHI_START, 1, Mixture.bidisperse(case.alpha))
        settings = Compression(KAPPA_START, PHI[case.alpha][0], 0.1, sides=2)
        with Session() as session:
            run = CompressionRun(session, settings, packing)
            run.advance(run.last_step)
            write_packing(path, run.packing())
    return read_packing(path)


def run_with(start: Packing, settings: Compression, steps: int) -> dict[str, Any]:
    """Pressures at the rows, and the cost."""
    with Session() as session:
        run = CompressionRun(session, settings, start)
        began, p = time.process_time(), []
        for k in range(1, steps + 1):
            run.advance(k)
            p.append(run.measure()["p"])
        seconds = time.process_time() - began
        last = run.measure()
    names = ("evaluations", "substeps", "rejected", "forced")
    return {"p": p, "seconds": seconds} | {name: last.get(name, 0.0) for name in names}


def heun_stretch(start: Packing, case: Case) -> dict[str, Any]:
    """Heun's method for a while: its cost for the whole, and its error at the end of the stretch."""
    whole = case.settings("heun", 1.0)
    fine = Compression(case.kappa, whole.phi_end, HEUN_STEPS * HEUN_DT, sides=2,
                       integrator=REFERENCE[0], tolerance=REFERENCE[1])  # fmt: skip
    exact = run_with(start, fine, 1)["p"][-1]
    settings = Compression(case.kappa, whole.phi_end, HEUN_DT, sides=2)
    with Session() as session:
        run = CompressionRun(session, settings, start)
        began = time.process_time()
        run.advance(HEUN_STEPS)
        seconds = time.process_time() - began
        error = abs(run.measure()["p"] / exact - 1)
    times = ROWS * whole.dt / (HEUN_STEPS * HEUN_DT)
    return {"seconds": seconds * times, "evaluations": 2 * HEUN_STEPS * times, "error": error}


def kept(path: Path, case: Case, method: str, tolerance: float) -> dict[str, Any]:
    """Return the run of before, or make it."""
    file = path / f"{case.name}_{method.replace('/', '-')}_{tolerance:g}.json"
    if not file.exists():
        start = start_state(path, case)
        found = (
            heun_stretch(start, case)
            if method == "heun"
            else run_with(start, case.settings(method, tolerance), ROWS)
        )
        file.write_text(json.dumps(found))
    return dict(json.loads(file.read_text()))


def rows_of(path: Path, case: Case, reference: float) -> Iterator[dict[str, Any]]:
    """Rows of the table for one compression."""
    exact = np.array(kept(path, case, REFERENCE[0], reference)["p"])
    of_case = {"n": case.n, "alpha": case.alpha, "kappa": case.kappa}
    heun = kept(path, case, "heun", HEUN_DT)
    yield of_case | {"method": "heun", "tolerance": None, "evaluations": heun["evaluations"],
                     "seconds": heun["seconds"], "median": heun["error"],
                     "largest": None}  # fmt: skip
    for method, tolerance in METHODS:
        run = kept(path, case, method, tolerance)
        error = np.abs(np.array(run["p"]) - exact) / exact
        yield of_case | {"method": method, "tolerance": tolerance,
                         "evaluations": run["evaluations"], "seconds": run["seconds"],
                         "rejected": run["rejected"] / run["substeps"],
                         "median": float(np.median(error)), "largest": float(error.max())}  # fmt: skip


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    lines = [
        "| N | alpha | kappa | integrator | tolerance | evaluations | seconds | p: median error | largest |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for r in rows:
        is_heun = r["method"] == "heun"
        lines.append(
            f"| {r['n']} | {r['alpha']:g} | {r['kappa']:g} | {r['method']} | "
            f"{f'dt = {HEUN_DT}, extrapolated' if is_heun else format(r['tolerance'], 'g')} | "
            f"{r['evaluations']:.2g} | {r['seconds']:.2g} | {r['median']:.1e} | "
            f"{'' if is_heun else format(r['largest'], '.1e')} |"
        )
    return "\n".join(lines) + "\n"


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Errors against evaluations, a panel for each compression."""
    import matplotlib as mpl  # noqa: PLC0415 - plotting only where a picture is made

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    cases = sorted(
        {(r["n"], r["alpha"], r["kappa"]) for r in rows}, key=lambda c: (c[1], c[0], -c[2])
    )
    columns = min(len(cases), 4)
    lines = -(-len(cases) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(3.2 * columns, 3 * lines), squeeze=False,
                                sharex=True, sharey=True, layout="constrained")  # fmt: skip
    colours = {"heun": "0.4", "heun/adaptive": "tab:blue", "rkc2": "tab:red"}
    for axis, case in itertools.zip_longest(axes.flat, cases):
        if case is None:
            axis.set_visible(False)
            continue
        of_case = [r for r in rows if (r["n"], r["alpha"], r["kappa"]) == case]
        for method, colour in colours.items():
            of = [r for r in of_case if r["method"] == method]
            cost = [r["evaluations"] for r in of]
            axis.loglog(cost, [r["median"] for r in of], "o-", color=colour, label=method)
            if method != "heun":
                axis.loglog(cost, [r["largest"] for r in of], "s--", color=colour, mfc="none")
        axis.set_title(
            rf"$N$ = {case[0]}, $\alpha$ = {case[1]:g}, $\kappa$ = {case[2]:g}", fontsize=9
        )
        axis.grid(visible=True, alpha=0.3)
    for axis in axes[:, 0]:
        axis.set_ylabel("relative error of p")
    for axis in axes[-1]:
        axis.set_xlabel("force evaluations")
    axes[0, 0].legend(title="filled: median, open: largest", fontsize=7, title_fontsize=7)
    figure.savefig(path, dpi=150)
    plt.close(figure)


def curves(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Median errors against seconds, one curve for each integrator and compression."""
    found: dict[str, dict[str, Any]] = {}
    for r in rows:
        name = f"{r['method']}, N = {r['n']}, alpha = {r['alpha']:g}, kappa = {r['kappa']:g}"
        curve = found.setdefault(name, {"name": name, "seconds": [], "error": []})
        curve["seconds"].append(r["seconds"])
        curve["error"].append(r["median"])
    return list(found.values())


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("runs/integrator_error"))
    parser.add_argument("--n", type=int, nargs="+", default=[128, 256])
    parser.add_argument("--alpha", type=float, nargs="+", default=list(PHI), choices=list(PHI))
    parser.add_argument("--kappa", type=float, nargs="+", default=[1e-5, 1e-6])
    parser.add_argument("--quick", action="store_true", help="N = 32, kappa = 1e-4")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    reference = REFERENCE[1]
    if options.quick:
        options.n, options.kappa, reference = [32], [1e-4], 1e-6
    cases = [Case(*c) for c in itertools.product(options.n, options.alpha, options.kappa)]
    rows: list[dict[str, Any]] = []
    with tqdm(cases, unit="case") as bar:
        for case in bar:
            bar.set_postfix_str(case.name)
            rows += rows_of(options.out, case, LOOSER.get((case.alpha, case.kappa), reference))
            text = table(rows)
            (options.out / "integrator_error.md").write_text(text)
            draw(rows, options.out / "integrator_error.png")
    print(text)
    print(json.dumps({"out": str(options.out), "rows": rows, "curves": curves(rows)}))


if __name__ == "__main__":
    main()
