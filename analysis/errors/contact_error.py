"""Error, iterations and time of superellipsoid contacts over exponents and axis ratios.

    python analysis/contact_error.py --out runs/contact_error

Random pairs of random orientation, semi-axes within a factor w of each other, sizes within ten, are
moved to just below contact. Of each exponent p (the same for both, and one row of random unequal
ones) and each w: the largest relative bound of the error of the scale, pairs whose bound is above
2e-14, pairs whose first attempt failed, iterations from no start and from the normal of a
moment before (centres moved by 1e-4 of a semi-axis), and the time of a contact with and without force
to be found. Writes a table (Markdown), a picture and the numbers (JSON). The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from jamshape import _contact

EXPONENTS = (0.55, 0.65, 0.75, 0.85, 1.0, 1.25, 1.5, 2.0, 3.0, 5.0, 10.0)
AXIS_RATIOS = (1.0, 3.0, 10.0)
SIZE_RATIO = 10.0
SCALE = 0.98  # of the pairs that are timed: a small overlap
APART = 1.1
CERTAIN = 2e-14

Array = NDArray[np.float64]


def bodies(rng: np.random.Generator, p: Array, axis_ratio: float, size_ratio: float) -> Array:
    """Rows of superellipsoid bodies in 3D."""
    n = len(p)
    half, size = 0.5 * np.log(axis_ratio), 0.5 * np.log(size_ratio)
    axes = np.exp(rng.uniform(-half, half, (n, 3)) + rng.uniform(-size, size, (n, 1)))
    turn = rng.normal(size=(n, 4))
    turn /= np.linalg.norm(turn, axis=1)[:, None]
    return np.hstack([rng.normal(size=(n, 3)), turn, axes, p[:, None]])


def moved(i: Array, j: Array, factor: Array) -> Array:
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
    anywhere = _contact.superellipsoid_scales(i, j)
    i = moved(i, j, SCALE / anywhere["eta"])
    cold = _contact.superellipsoid_scales(i, j)
    beside = i.copy()
    beside[:, :3] += 1e-4 * i[:, 7:10].min(axis=1)[:, None] * rng.normal(size=(n, 3))
    warm = _contact.superellipsoid_scales(beside, j, cold["normal"])
    apart = moved(i, j, np.full(n, APART / SCALE))
    return {
        "p": p,
        "axis_ratio": axis_ratio,
        "pairs": 3 * n,
        "largest_gap": float(max(s["gap"].max() for s in (anywhere, cold, warm))),
        "scale_error": float(np.abs(cold["eta"] / SCALE - 1.0).max()),
        "uncertain": int(sum(np.sum(~(s["gap"] < CERTAIN)) for s in (anywhere, cold, warm))),
        "fallbacks": int(sum(s["fallback"].sum() for s in (anywhere, cold, warm))),
        "iterations": float(cold["iterations"].mean()),
        "iterations_most": int(cold["iterations"].max()),
        "iterations_warm": float(warm["iterations"].mean()),
        "microseconds": shortest_time(_contact.superellipsoid_contacts, i, j, 1.0),
        "microseconds_warm": shortest_time(
            _contact.superellipsoid_scales, beside, j, cold["normal"]
        ),
        "microseconds_apart": shortest_time(_contact.superellipsoid_contacts, apart, j, 1.0),
        "microseconds_overlap": shortest_time(_contact.superellipsoid_overlap, i, j),
    }


def table(rows: list[dict[str, Any]]) -> str:
    """Write the rows as Markdown."""
    head = "| p | w | largest gap | uncertain | fallbacks, of | iterations, most | warm | "
    head += "us contact | us warm | us apart | us overlap |"
    lines = [head, "|" + 11 * " --- |"]
    lines += [
        f"| {r['p'] or 'any'} | {r['axis_ratio']:g} | {r['largest_gap']:.1e} | {r['uncertain']} | "
        f"{r['fallbacks']}, {r['pairs']} | {r['iterations']:.1f}, {r['iterations_most']} | "
        f"{r['iterations_warm']:.1f} | {r['microseconds']:.2f} | {r['microseconds_warm']:.2f} | "
        f"{r['microseconds_apart']:.2f} | {r['microseconds_overlap']:.2f} |"
        for r in rows
    ]
    return "\n".join(lines) + "\n"


def draw(rows: list[dict[str, Any]], path: Path) -> None:
    """Gap, iterations and time against p, one line per axis ratio."""
    import matplotlib as mpl  # noqa: PLC0415 - plotting only where a picture is made

    mpl.use("Agg")
    from matplotlib import pyplot as plt  # noqa: PLC0415

    figure, axes = plt.subplots(1, 3, figsize=(12, 4), layout="constrained")
    panels = (
        ("largest_gap", None, "largest relative error bar"),
        ("iterations", "iterations_warm", "iterations"),
        ("microseconds", "microseconds_warm", "time of a contact (us)"),
    )
    for axis, (cold, warm, label) in zip(axes, panels, strict=True):
        for k, ratio in enumerate(AXIS_RATIOS):
            of = [r for r in rows if r["axis_ratio"] == ratio and r["p"] is not None]
            p = [r["p"] for r in of]
            axis.plot(p, [r[cold] for r in of], "o-", color=f"C{k}", label=f"w = {ratio:g}")
            if warm:
                axis.plot(p, [r[warm] for r in of], "s--", color=f"C{k}", mfc="none")
        axis.set(xscale="log", yscale="log", xlabel="p", ylabel=label)
        axis.grid(visible=True, alpha=0.3)
    axes[1].plot([], [], "s--", color="grey", mfc="none", label="warm start")
    axes[1].legend()
    figure.savefig(path, dpi=150)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=Path("runs/contact_error"))
    parser.add_argument("--pairs", type=int, default=20000, help="of each p and w")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(options.seed)
    cases = [(p, w) for w in AXIS_RATIOS for p in (*EXPONENTS, None)]
    rows = [measure(rng, p, w, options.pairs) for p, w in tqdm(cases, unit="case")]
    text = table(rows)
    (options.out / "contact_error.md").write_text(text)
    (options.out / "contact_error.json").write_text(json.dumps(rows, indent=1))
    draw(rows, options.out / "contact_error.png")
    print(text)
    totals = {key: sum(r[key] for r in rows) for key in ("pairs", "uncertain", "fallbacks")}
    curves = [
        {"name": f"w = {r['axis_ratio']:g}, p = {r['p']}", "seconds": [1e-6 * r["microseconds"]],
         "error": [r["largest_gap"]]}
        for r in rows
    ]  # fmt: skip
    print(json.dumps({"out": str(options.out), **totals, "curves": curves}))


if __name__ == "__main__":
    main()
