"""phi_J from pressures that go to zero, and from energies that go to zero, of the same seeds.

    python analysis/stress/jamming_from_pressure.py --samples 8 --out jamming_from_pressure.png

Discs and rods of alpha = 1 and 4 in 2D, spheres and spheroids in 3D. A packing is made at the highest pressure, in a box that changes its volume
only, and another one of the same seed at the energy u that the first one has there; they are the same state if phi and the
contacts agree. The first is led to lower pressures, the second to energies lower by the square of the same factor. phi is linear
in p and in sqrt(u) as long as no contact changes: phi_J is extrapolated through the two lowest points, and its error is the difference to the
two points before. Finished packings are kept in --runs: a command that is stopped and repeated goes on. The last line of standard
output is one JSON object.
"""

from __future__ import annotations

import json
import sys
import warnings
from argparse import ArgumentParser, Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

import jamshape as js
from jamshape.checks import NotReachedWarning
from jamshape.command import parser_of, report, run
from jamshape.drawing.saving import save_figure
from jamshape.shapes.particles import Particles

sys.path.insert(0, str(Path(__file__).parents[1]))
from common.axes import figure_of
from common.stressed import add_folder, found_of, write_table
from common.styles import marked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRESSURES = (1e-5, 1e-6, 1e-7)
SAME = 1e-9  # relative difference of phi of the same state
LEAST = 1e-16  # on the axis of differences


class Shape(NamedTuple):
    """Particles of the comparison."""

    particles: Particles
    dimension: int
    label: str


SHAPES = {
    "discs": Shape(js.Spherocylinders(alpha=0), 2, r"spherocylinders in 2D, $\alpha=0$ (discs)"),
    "rods1": Shape(js.Spherocylinders(alpha=1), 2, r"spherocylinders in 2D, $\alpha=1$"),
    "rods4": Shape(js.Spherocylinders(alpha=4), 2, r"spherocylinders in 2D, $\alpha=4$"),
    "spheres": Shape(js.Superellipsoids(w1=1.0), 3, "superellipsoids in 3D, $w_1=1$ (spheres)"),
    "spheroids": Shape(js.Superellipsoids(w1=0.7), 3, "superellipsoids in 3D, $w_1=0.7$"),
}


class Case(NamedTuple):
    """One seed of a shape."""

    shape: str
    n: int
    seed: int

    @property
    def file(self) -> str:
        """Name of the file of its results."""
        return f"jamming_{self.shape}_n{self.n}_s{self.seed}.json"


def compared(*case: Any) -> dict[str, Any]:
    """Lead a packing to low pressures, and the one of the same seed to low energies."""
    of = Case(*case)
    shape = SHAPES[of.shape]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotReachedWarning)  # `reached` tells
        settings: dict[str, Any] = {
            "n": of.n,
            "dimension": shape.dimension,
            "seed": of.seed,
            "progress": False,
        }
        at_p = [js.make_packing(shape.particles, pressure=PRESSURES[0], **settings)]
        at_u = [js.make_packing(shape.particles, u0=at_p[0].u, **settings)]
        for p in PRESSURES[1:]:
            at_p.append(js.minimise(at_p[-1], pressure=p, box="isotropic", progress=False))
            u0 = at_u[0].u * (p / PRESSURES[0]) ** 2
            at_u.append(js.minimise(at_u[-1], u0=u0, progress=False))
    return {
        "p": [one.results["pressure"] for one in at_p],
        "phi_at_p": [one.phi for one in at_p],
        "u": [one.u for one in at_u],
        "phi_at_u": [one.phi for one in at_u],
        "contacts": [[one.results["n_contacts"] for one in of] for of in (at_p, at_u)],
        "reached": [[one.reached for one in of] for of in (at_p, at_u)],
    }


class Onset(NamedTuple):
    """An extrapolated packing fraction."""

    value: float
    error: float


def onset_of(x: Sequence[float], phi: Sequence[float]) -> Onset:
    """Extrapolate to x = 0 through the last two points; the error is the difference to the two before."""
    found = [
        phi[k] - x[k] * (phi[k] - phi[k - 1]) / (x[k] - x[k - 1]) for k in (len(x) - 1, len(x) - 2)
    ]
    return Onset(found[0], abs(found[0] - found[1]))


class Pair(NamedTuple):
    """Both onsets of a seed."""

    seed: int
    by_pressure: Onset
    by_energy: Onset
    is_same: bool
    """Whether both are one state at the highest pressure."""
    reached: bool

    @property
    def difference(self) -> float:
        """Difference of the onsets."""
        return abs(self.by_pressure.value - self.by_energy.value)

    @property
    def error(self) -> float:
        """Sum of their errors."""
        return self.by_pressure.error + self.by_energy.error


def pair_of(seed: int, found: dict[str, Any]) -> Pair:
    """Extrapolate."""
    phi, other = found["phi_at_p"], found["phi_at_u"]
    at_p, at_u = found["contacts"]
    is_same = abs(other[0] / phi[0] - 1) < SAME and at_p[0] == at_u[0]
    return Pair(
        seed,
        onset_of(found["p"], phi),
        onset_of(np.sqrt(found["u"]), other),
        is_same,
        bool(np.all(found["reached"])),
    )


def figure_from(pairs: dict[str, list[Pair]], n: int) -> Figure:
    """Draw both onsets against each other, and their differences with errors."""
    figure = figure_of(9.5, 4.6, dpi=160)
    left, right = figure.subplots(1, 2)
    for k, (name, of) in enumerate(pairs.items()):
        style = marked(k)
        both = np.array([(one.by_energy.value, one.by_pressure.value) for one in of])
        left.errorbar(*both.T, **style, label=SHAPES[name].label)
        same = [one for one in of if one.is_same]
        x = k + np.linspace(-0.3, 0.3, len(same))
        right.errorbar(
            x,
            [max(one.difference, LEAST) for one in same],
            **style,
            label=r"$|\Delta\phi_J|$ of " + name,
        )
        right.plot(x, [max(one.error, LEAST) for one in same], "_", ms=9, color=style["color"])
    ends = left.get_xlim()
    left.plot(ends, ends, "-", color="0.6", lw=0.8, zorder=0)
    left.set(xlabel=r"$\phi_J$ by $u\to0$", ylabel=r"$\phi_J$ by $p\to0$")
    left.set_title("all seeds; line: equal", fontsize=9)
    left.legend(fontsize=7)
    right.set(yscale="log", ylabel=r"difference of $\phi_J$")
    right.set_xticks(range(len(pairs)), list(pairs))
    right.set_title("seeds of one state; dashes: sum of both errors", fontsize=9)
    right.legend(fontsize=7)
    low = f"{PRESSURES[0]:.0e} to {PRESSURES[-1]:.0e}"
    figure.suptitle(
        f"$N={n}$, size ratio 1.4 in 2D, isotropic boxes, $p$ from {low} in $k_e$ per area or volume",
        fontsize=9,
    )
    return figure


def mean_of(values: Sequence[float]) -> Onset:
    """Average over seeds, with the standard error."""
    error = np.std(values, ddof=1) / len(values) ** 0.5 if len(values) > 1 else np.nan
    return Onset(float(np.mean(values)), float(error))


def summary(of: list[Pair]) -> dict[str, Any]:
    """Describe a shape in JSON."""
    same = [one for one in of if one.is_same and one.reached]
    onsets = {
        "by_pressure": [one.by_pressure.value for one in of],
        "by_energy": [one.by_energy.value for one in of],
    }
    means = {name: mean_of(values) for name, values in onsets.items()}
    return {
        "samples": len(of),
        "reached": sum(one.reached for one in of),
        "phi_J": means,
        "same_state": len(same),
        "within_errors": sum(one.difference <= one.error for one in same),
        "largest_difference": max((one.difference for one in same), default=None),
        "median_difference": float(np.median([one.difference for one in same])) if same else None,
        "median_error": float(np.median([one.error for one in same])) if same else None,
    }


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__, "jamming_from_pressure.png")
    found.add_argument("--shapes", nargs="+", choices=list(SHAPES), default=list(SHAPES))
    found.add_argument("--n", type=int, default=64)
    add_folder(found, samples=8)
    return found


def main(options: Namespace) -> None:
    """Make, extrapolate, draw, report."""
    every = [
        Case(name, options.n, seed)
        for seed in range(1, options.samples + 1)
        for name in options.shapes
    ]
    if not options.only_kept:
        found_of(options.runs, every, options.jobs, "stress.jamming_from_pressure:compared")
    pairs: dict[str, list[Pair]] = {name: [] for name in options.shapes}
    for one in every:
        if (path := options.runs / one.file).exists():
            pairs[one.shape].append(pair_of(one.seed, json.loads(path.read_text())))
    save_figure(figure_from(pairs, options.n), options.out)
    found = {name: summary(of) for name, of in pairs.items()}
    write_table(options, found)
    report({"out": options.out, "shapes": found})


if __name__ == "__main__":
    run(parser(), main)
