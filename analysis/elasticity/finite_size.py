"""Mean shear modulus and bulk modulus of discs in fixed boxes, and the fraction unstable to shear, by p N^2.

    python analysis/elasticity/finite_size.py --n 64 128 256 --u0 1e-10 1e-8 1e-6 1e-4 --seeds 100 --out runs/finite_size

Bidisperse discs (`js.Spherocylinders(alpha=0)`), harmonic, at fixed energies u0. G is the mean shear modulus over directions, G_dc, and
includes negative ones; N is the number of particles without rattlers. G N and B against p N^2 as in Goodrich, Liu and Sethna, PRE 90, 022138
(2014), whose discs are harmonic as well; unstable packings as in Dagois-Bohy et al., PRL 109, 095703 (2012). Errors are standard errors of the mean, of the
fraction that of the binomial distribution. Finished packings are kept in the folder, and the same command continues. Writes
averages.csv and finite_size.png. The last line of standard output is one JSON object.
"""

from __future__ import annotations

import csv
import json
import math
import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

import jamshape as js
from jamshape.command import parser_of, plain, report, run
from jamshape.drawing.saving import save_figure
from jamshape.files.disk import store

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.styles import marked

LOWEST = 4  # modes beside the moduli


def measure(n: int, u0: float, seed: int) -> dict[str, Any]:
    """Make one packing; undefined moduli become null in the file."""
    packing = js.make_packing(js.Spherocylinders(alpha=0), n=n, u0=u0, seed=seed, progress=False)
    found = js.modes(packing, lowest=LOWEST, force=True)
    own = found.moduli
    return {
        "n": found.attributes["n_backbone"],
        "pressure": own.pressure,
        "G": own.B.G_dc.relaxed,
        "bulk": own.bulk.relaxed,
        "eigenvalue": own.bordered.value,
        "stable": own.is_stable_to_shear,
    }


def kept(path: Path, n: int, u0: float, seed: int) -> dict[str, Any]:
    """Return what was found before, or find it."""
    if not path.exists():
        store(path, json.dumps(plain(measure(n, u0, seed))).encode())
    found: dict[str, Any] = json.loads(path.read_text())
    return found


def averages(n: int, u0: float, rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Average over the packings of one size and energy whose moduli are defined and whose stability is decided."""
    used = [row for row in rows if row["G"] is not None and row["stable"] is not None]
    found: dict[str, Any] = {"n": n, "u0": u0, "packings": len(rows), "used": len(used)}
    values = {
        "pN2": [row["pressure"] * row["n"] ** 2 for row in used],
        "GN": [row["G"] * row["n"] for row in used],
        "GN_stable": [row["G"] * row["n"] for row in used if row["stable"]],
        "bulk": [row["bulk"] for row in used],
    }
    for name, of in values.items():
        known = len(of) > 1
        found[name] = float(np.mean(of)) if of else None
        found[f"{name}_error"] = float(np.std(of, ddof=1) / math.sqrt(len(of))) if known else None
    unstable = float(np.mean([not row["stable"] for row in used])) if used else None
    error = math.sqrt(unstable * (1 - unstable) / len(used)) if unstable is not None else None
    return found | {"unstable": unstable, "unstable_error": error}


def draw(points: list[dict[str, Any]], path: Path) -> None:
    """Draw G N, B and the unstable fraction against p N^2."""
    figure = figure_of(9.6, 3.2, dpi=160)
    labels = {"GN": "$G N$", "bulk": "$B$", "unstable": "fraction unstable to shear"}
    panels = figure.subplots(1, len(labels))
    for axes, (name, label) in zip(panels, labels.items(), strict=True):
        for k, n in enumerate(sorted({point["n"] for point in points})):
            own = [p for p in points if p["n"] == n and p.get(f"{name}_error") is not None]
            x, y, error = ([p[key] for p in own] for key in ("pN2", name, f"{name}_error"))
            axes.errorbar(x, y, error, label=f"$N={n}$", **marked(k, "-"))
        axes.set(xscale="log", xlabel="$p N^2$", ylabel=label)
    panels[0].set_yscale("log", nonpositive="mask")
    panels[0].legend(fontsize=7)
    save_figure(figure, path)


def main(options: Namespace) -> None:
    """Measure, average, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    points = []
    for n in options.n:
        for u0 in options.u0:
            seeds = range(1, options.seeds + 1)
            rows = [kept(options.out / f"{n}_{u0:g}_{k}.json", n, u0, k) for k in seeds]
            points.append(averages(n, u0, rows))
            print(json.dumps(points[-1]), flush=True)
    with (options.out / "averages.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(points[0]))
        writer.writeheader()
        writer.writerows(points)
    draw(points, options.out / "finite_size.png")
    report({"out": options.out, "points": points})


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/finite_size")
    found.add_argument("--n", type=int, nargs="+", default=[64, 128, 256], help="particles")
    found.add_argument(
        "--u0", type=float, nargs="+", default=[1e-10, 1e-8, 1e-6, 1e-4], help="energies"
    )
    found.add_argument("--seeds", type=int, default=100, help="packings of each (100)")
    return found


if __name__ == "__main__":
    run(parser(), main)
