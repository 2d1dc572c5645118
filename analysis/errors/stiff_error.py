"""Error and cost of the implicit integrator of slow compressions, beside Heun's method.

    python analysis/stiff_error.py --alpha 4 --n 256 --kappas 1e-6 1e-8 1e-10 --out runs/stiff_error

One state just below jamming is compressed through it at each rate with each tolerance; errors of p are against
the run of that rate with the smallest tolerance. The cost of Heun's method with dt = 0.01 is that of a
measured stretch times the number of its steps. Writes a table (Markdown), a picture and the numbers
(JSON); finished runs are kept and not repeated. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import json
import math
import time
from argparse import ArgumentParser, Namespace, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jamshape.files.h5md import read_packing, write_packing
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.flow.implicit import METHODS, Flow, Protocol, compress
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.protocols.random_start import Mixture, random_packing

HEUN_DT = 0.01
HEUN_STEPS = 2000
SAMPLES = 60
RATE_BEFORE = 1e-6


def start_state(options: Namespace) -> Packing:
    """Make the state that every run starts from, once: Heun first, then slowly."""
    path = options.out / f"start_{options.alpha:g}_{options.n}_{options.seed}.h5"
    if not path.exists():
        mixture = Mixture.bidisperse(options.alpha)
        packing = random_packing(options.n, 0.4, options.seed, mixture)
        with Session() as session:
            settings = Compression(1e-4, options.phi_from - 0.05, 0.2, 2)
            run = CompressionRun(session, settings, packing)
            run.advance(run.last_step)
            packing = run.packing()
        landscape, flow = Landscape(packing), Flow(State.of(packing))
        for _ in compress(landscape, flow, Protocol(RATE_BEFORE, options.phi_from)):
            pass
        write_packing(path, flow.state.packing(packing))
    return read_packing(path)


def run_with(start: Packing, options: Namespace, kappa: float, tolerance: float) -> dict[str, Any]:
    """Compress; pressures at common packing fractions, and what they cost."""
    landscape, flow = Landscape(start), Flow(State.of(start))
    samples = np.linspace(start.phi, options.phi_to, SAMPLES + 1)
    # Steps end where the rate may change.
    rates = tuple((float(phi), kappa) for phi in samples[:-1])
    protocol = Protocol(rates, options.phi_to, tolerance=tolerance, method=options.method)
    phi, p, began = [], [], time.process_time()
    bar = tqdm(total=SAMPLES, desc=f"kappa {kappa:g} tolerance {tolerance:g}", leave=False)
    for step in compress(landscape, flow, protocol):
        if abs(samples - step.phi).min() < 1e-11:
            phi.append(step.phi)
            p.append(step.p)
            bar.update()
        cpu = time.process_time() - began
        if cpu > options.seconds:
            break
    counts = {k: v for k, v in step._asdict().items() if k not in ("phi", "p", "step")}
    return {
        "kappa": kappa, "tolerance": tolerance, "method": options.method, "phi": phi, "p": p,
        "steps": step.step, "cpu_seconds": cpu, "phi_reached": step.phi, "phi_from": start.phi,
        **counts,
    }  # fmt: skip


def kept(path: Path, make: Any, *arguments: Any) -> dict[str, Any]:
    """Return what was found before, or find it."""
    if not path.exists():
        path.write_text(json.dumps(make(*arguments)))
    return dict(json.loads(path.read_text()))


def heun_cost(start: Packing) -> dict[str, float]:
    """Seconds of an evaluation in LAMMPS, by a stretch of Heun steps, in processor time."""
    with Session() as session:
        run = CompressionRun(session, Compression(1e-6, 10.0, HEUN_DT, 2), start)
        run.advance(session.step + 100)
        began = time.process_time()
        run.advance(session.step + HEUN_STEPS)
        return {"seconds_per_step": (time.process_time() - began) / HEUN_STEPS}


def row(run: dict[str, Any], reference: dict[str, Any], heun: dict[str, float]) -> dict[str, Any]:
    """One row of the table."""
    n = min(len(run["p"]), len(reference["p"]))
    p, exact = np.array(run["p"][:n]), np.array(reference["p"][:n])
    error = np.abs(p - exact) / exact if run is not reference else np.full(n, np.nan)
    steps = run["strain"] / (run["kappa"] * HEUN_DT)
    names = ("kappa", "tolerance", "steps", "evaluations", "factorisations", "rejected", "explicit",
             "cpu_seconds", "phi_reached")  # fmt: skip
    found = {name: run[name] for name in names}
    found |= {"p_median": float(np.median(error)), "p_largest": float(error.max(initial=0))}
    found |= {"fewer_evaluations": 2 * steps / run["evaluations"]}
    return found | {"less_time": steps * heun["seconds_per_step"] / run["cpu_seconds"]}


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    names = (
        *("kappa", "tolerance", "steps", "evaluations", "factorisations", "seconds"),
        *("p: median error", "p: largest", "evaluations: fewer than Heun by", "time: less by"),
    )
    lines = ["| " + " | ".join(names) + " |", "| --- " * len(names) + "|"]
    lines += [
        f"| {r['kappa']:g} | {r['tolerance']:g} | {r['steps']} | {r['evaluations']} | "
        f"{r['factorisations']} | {r['cpu_seconds']:.3g} | {r['p_median']:.1e} | {r['p_largest']:.1e}"
        f" | {r['fewer_evaluations']:.1e} | {r['less_time']:.1e} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"


def draw(runs: list[dict[str, Any]], rows: list[dict[str, Any]], path: Path) -> None:
    """p(phi) of the smallest tolerances, and errors against run time."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - not needed for --help
    from matplotlib.ticker import NullFormatter  # noqa: PLC0415

    figure = Figure(figsize=(9, 4), dpi=150, layout="constrained")
    left, right = figure.subplots(1, 2)
    kappas = sorted({run["kappa"] for run in runs}, reverse=True)
    for k, kappa in enumerate(kappas):
        of = [run for run in runs if run["kappa"] == kappa]
        best = min(of, key=lambda run: run["tolerance"])
        left.semilogy(best["phi"], best["p"], color=f"C{k}", label=rf"$\kappa$ = {kappa:g}")
        points = [r for r in rows if r["kappa"] == kappa and math.isfinite(r["p_median"])]
        seconds = [r["cpu_seconds"] for r in points]
        right.loglog(
            seconds, [r["p_median"] for r in points], "o-", color=f"C{k}", label="median" * (k == 0)
        )
        right.loglog(seconds, [r["p_largest"] for r in points], "s--", color=f"C{k}", mfc="none",
                     label="largest" * (k == 0))  # fmt: skip
    left.set(xlabel=r"packing fraction $\phi$", ylabel="pressure $p$")
    right.set(xlabel="processor time (s)", ylabel="relative error of p")
    right.xaxis.set_minor_formatter(NullFormatter())
    left.legend(fontsize=8)
    right.legend(fontsize=8)
    figure.savefig(path)


def curves(rows: list[dict[str, Any]], options: Namespace) -> list[dict[str, Any]]:
    """Median errors against seconds, one curve for each rate."""
    found = []
    for kappa in options.kappas:
        of = [r for r in rows if r["kappa"] == kappa and math.isfinite(r["p_median"])]
        found += [{"name": f"kappa = {kappa:g}, alpha = {options.alpha:g}",
                   "seconds": [r["cpu_seconds"] for r in of],
                   "error": [r["p_median"] for r in of]}]  # fmt: skip
    return found


def main() -> None:
    """Command line."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("runs/stiff_error"))
    parser.add_argument("--alpha", type=float, default=4.0)
    parser.add_argument("--n", type=int, default=256)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kappas", type=float, nargs="+", default=[1e-6, 1e-7, 1e-8, 1e-9, 1e-10])
    parser.add_argument("--tolerances", type=float, nargs="+", default=[1e-2, 1e-3, 1e-4])
    parser.add_argument("--phi-from", type=float, default=0.845)
    parser.add_argument("--phi-to", type=float, default=0.87)
    parser.add_argument("--method", choices=METHODS, default="tr-bdf2")
    parser.add_argument("--seconds", type=float, default=math.inf, help="for one run, at most")
    parser.add_argument("--quick", action="store_true", help="N = 32, two rates, under a minute")
    options = parser.parse_args()
    if options.quick:
        options.n, options.kappas, options.tolerances = 32, [1e-6, 1e-8], [1e-2, 1e-3]
        options.phi_to, options.seconds = options.phi_from + 0.005, 10.0
    options.out.mkdir(parents=True, exist_ok=True)
    start, runs, rows = start_state(options), [], []
    tag = f"{options.alpha:g}_{options.n}_{options.seed}_{options.phi_to:g}"
    heun = kept(options.out / f"heun_{options.alpha:g}_{options.n}.json", heun_cost, start)
    for kappa in options.kappas:
        for tolerance in sorted(options.tolerances, reverse=True):
            path = options.out / f"run_{tag}_{options.method}_{kappa:g}_{tolerance:g}.json"
            runs.append(kept(path, run_with, start, options, kappa, tolerance))
        rows += [row(r, runs[-1], heun) for r in runs if r["kappa"] == kappa]
        text = table(rows)
        (options.out / f"stiff_error_{tag}.md").write_text(text)
    draw(runs, rows, options.out / f"stiff_error_{tag}.png")
    print(text)
    found = {"out": str(options.out), "heun": heun, "rows": rows}
    print(json.dumps(found | {"curves": curves(rows, options)}))


if __name__ == "__main__":
    main()
