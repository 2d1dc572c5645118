"""Error, iterations and time of superellipsoid contacts over exponents and axis ratios.

    python analysis/errors/contact_error.py --out runs/contact_error

Random pairs of random orientation, semi-axes within a factor w of each other, sizes within ten, are
moved to just below contact. Of each exponent p (the same for both, and one row of random unequal
ones) and each w: the largest relative bound of the error of the scale, pairs whose bound is above
2e-14, pairs whose first attempt failed, pairs for which doubles are too short, iterations from no start and from the normal of a
moment before (centres moved by 1e-4 of a semi-axis), and the time of a contact with and without force
to be found. Writes a table (Markdown), a picture and the numbers (JSON). The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import json
import time
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np
from studies.shown import Point, curves, figure_of, markdown
from tqdm import tqdm

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.shapes.single_pairs import (
    superellipsoid_contacts,
    superellipsoid_overlap,
    superellipsoid_scales,
)

EXPONENTS = (0.55, 0.65, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0)
AXIS_RATIOS = (1.0, 3.0, 10.0)
SIZE_RATIO = 10.0
SCALE = 0.98  # of the pairs that are timed: a small overlap
APART = 1.1
CERTAIN = 2e-14

HEADS = ("p", "w", "largest gap", "uncertain", "fallbacks, of", "in long doubles",
         "iterations, most", "warm",
         "us contact", "us warm", "us apart", "us overlap")  # fmt: skip


def bodies(
    rng: np.random.Generator, p: FloatArray, axis_ratio: float, size_ratio: float
) -> FloatArray:
    """Rows of superellipsoid bodies in 3D."""
    n = len(p)
    half, size = 0.5 * np.log(axis_ratio), 0.5 * np.log(size_ratio)
    axes = np.exp(rng.uniform(-half, half, (n, 3)) + rng.uniform(-size, size, (n, 1)))
    turn = rng.normal(size=(n, 4))
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    return np.hstack([rng.normal(size=(n, 3)), turn, axes, p[:, None]])


def moved(i: FloatArray, j: FloatArray, factor: FloatArray) -> FloatArray:
    """Bodies i with their distances from j multiplied."""
    result = i.copy()
    result[:, :3] = j[:, :3] + factor[:, None] * (i[:, :3] - j[:, :3])
    return result


def shortest_time(function: Any, *arguments: Any) -> float:
    """Microseconds of processor time a pair, reading its row included; best of five."""
    best = np.inf
    for _ in range(5):
        began = time.process_time()
        function(*arguments)
        best = min(best, time.process_time() - began)
    return float(1e6 * best / len(arguments[0]))


def measure(rng: np.random.Generator, p: float | None, axis_ratio: float, n: int) -> dict[str, Any]:
    """All numbers of one exponent (None: random unequal ones) and one axis ratio."""
    exponents = rng.choice(EXPONENTS, (2, n)) if p is None else np.full((2, n), p)
    i = bodies(rng, exponents[0], axis_ratio, 1.0)
    j = bodies(rng, exponents[1], axis_ratio, SIZE_RATIO)
    anywhere = superellipsoid_scales(i, j)
    i = moved(i, j, SCALE / anywhere["eta"])
    cold = superellipsoid_scales(i, j)
    beside = i.copy()
    beside[:, :3] += 1e-4 * i[:, 7:10].min(axis=1)[:, None] * rng.normal(size=(n, 3))
    warm = superellipsoid_scales(beside, j, cold["normal"])
    found = (anywhere, cold, warm)
    return {
        "exponent": p,
        "axis_ratio": axis_ratio,
        "pairs": 3 * n,
        "largest_gap": float(max(s["gap"].max() for s in found)),
        "scale_error": float(np.abs(cold["eta"] / SCALE - 1.0).max()),
        "uncertain": int(sum(np.sum(~(s["gap"] < CERTAIN)) for s in found)),
        "fallbacks": int(sum(s["fallback"].sum() for s in found)),
        "extended": int(sum(s["extended"].sum() for s in found)),
        "iterations": float(cold["iterations"].mean()),
        "iterations_most": int(cold["iterations"].max()),
        "iterations_warm": float(warm["iterations"].mean()),
        "microseconds_warm": shortest_time(superellipsoid_scales, beside, j, cold["normal"]),
        **times(i, j),
    }


def times(i: FloatArray, j: FloatArray) -> dict[str, float]:
    """Microseconds of a contact, of a pair that is apart, and of the question whether two overlap."""
    apart = moved(i, j, np.full(len(i), APART / SCALE))
    return {
        "microseconds": shortest_time(superellipsoid_contacts, i, j, 1.0),
        "microseconds_apart": shortest_time(superellipsoid_contacts, apart, j, 1.0),
        "microseconds_overlap": shortest_time(superellipsoid_overlap, i, j),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    cells = [
        (str(r["exponent"] or "any"), f"{r['axis_ratio']:g}", f"{r['largest_gap']:.1e}",
         str(r["uncertain"]), f"{r['fallbacks']}, {r['pairs']}", str(r["extended"]),
         f"{r['iterations']:.1f}, {r['iterations_most']}", f"{r['iterations_warm']:.1f}",
         f"{r['microseconds']:.2f}", f"{r['microseconds_warm']:.2f}",
         f"{r['microseconds_apart']:.2f}", f"{r['microseconds_overlap']:.2f}")
        for r in rows
    ]  # fmt: skip
    return markdown(HEADS, cells)


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Gap, iterations and time against p, one line per axis ratio."""
    figure = figure_of(12, 4.2, "contacts of two superellipsoids in space, sizes within ten")
    axes = figure.subplots(1, 3)
    panels = (
        ("largest_gap", None, "largest relative error bar"),
        ("iterations", "iterations_warm", "iterations"),
        ("microseconds", "microseconds_warm", "time of a contact (us)"),
    )
    for axis, (cold, warm, label) in zip(axes, panels, strict=True):
        for k, ratio in enumerate(AXIS_RATIOS):
            of = [r for r in rows if r["axis_ratio"] == ratio and r["exponent"] is not None]
            p = [r["exponent"] for r in of]
            axis.plot(p, [r[cold] for r in of], "o-", color=f"C{k}", label=f"w = {ratio:g}")
            if warm:
                axis.plot(p, [r[warm] for r in of], "s--", color=f"C{k}", mfc="none")
        axis.set(xscale="log", yscale="log", xlabel="exponent $p$", ylabel=label)
        axis.grid(visible=True, alpha=0.3)
    axes[1].plot([], [], "s--", color="grey", mfc="none", label="warm start")
    axes[1].legend()
    save_figure(figure, path)


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "runs/contact_error")
    found.add_argument("--pairs", type=int, default=20000, help="of each p and w")
    found.add_argument("--seed", type=int, default=1)
    return found


def main(options: Namespace) -> None:
    """Measure, draw, report."""
    options.out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(options.seed)
    cases = [(p, w) for w in AXIS_RATIOS for p in (*EXPONENTS, None)]
    rows = [measure(rng, p, w, options.pairs) for p, w in tqdm(cases, unit="case")]
    text = table(rows)
    (options.out / "contact_error.md").write_text(text)
    (options.out / "contact_error.json").write_text(json.dumps(rows, indent=1))
    draw(rows, options.out / "contact_error.png")
    print(text)
    totals = {
        key: sum(r[key] for r in rows) for key in ("pairs", "uncertain", "fallbacks", "extended")
    }
    points = [
        Point(
            f"w = {r['axis_ratio']:g}, p = {r['exponent']}",
            1e-6 * r["microseconds"],
            r["largest_gap"],
        )
        for r in rows
    ]
    report({"out": options.out, **totals, "curves": curves(points)})


if __name__ == "__main__":
    run(parser(), main)
