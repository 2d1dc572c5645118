"""Draw a packing of 2D spherocylinders or discs: Fig. 7 of Marschall & Teitel, PRE 97, 012905.

    python analysis/draw.py FILE [--frame -1] --out packing.png

FILE is H5MD, a LAMMPS dump or a data file. Big particles are blue, small ones green and rattlers grey
(unless all are); black lines are along the spines, red dots where they touch. The last line of
standard output is one JSON object with what was counted.
"""

from __future__ import annotations

import contextlib
import json
import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts import ContactNetwork, coordination, find_contacts, find_rattlers
from jamshape.files.h5md import FileFormatError, read_attributes
from jamshape.files.lammps_text import read_any
from jamshape.packing import Box, Packing

SMALL, BIG, RATTLER, CONTACT = "#86c98a", "#6ea6dc", "#cfcfcf", "#d7191c"
INCHES, MARGIN = 7.0, np.array([0.1, 0.35])  # of the longer edge, around the box
SHORTEST = 0.6  # half length of a line along a spine where A is less, over R


def images(position: FloatArray, reach: FloatArray, box: Box) -> tuple[IntArray, FloatArray]:
    """Find the owners and positions of all periodic images that reach into the box."""
    inside = box.lo + (position - box.lo) % box.edges
    turns = np.ceil(reach.max(axis=0, initial=0) / box.edges).astype(int)
    found = []
    for shift in np.ndindex(*(2 * turns + 1)):
        moved = inside + (np.array(shift) - turns) * box.edges
        seen = ((moved > box.lo - reach) & (moved < box.lo + box.edges + reach)).all(axis=1)
        found.append((np.flatnonzero(seen), moved[seen]))
    return np.concatenate([i for i, _ in found]), np.concatenate([x for _, x in found])


def outlines(center: FloatArray, axis: FloatArray, A: ArrayLike, R: ArrayLike) -> FloatArray:
    """Trace spherocylinders: (N, V, 2) vertices; half length and radius may be one number."""
    vertices = int(np.clip(400 / np.sqrt(len(center) + 1), 8, 64))
    angle = np.linspace(-np.pi / 2, np.pi / 2, vertices)
    cap = np.column_stack([np.cos(angle), np.sin(angle)])
    unit = np.concatenate([cap, -cap])
    along = np.multiply.outer(R, unit[:, 0]) + np.multiply.outer(A, np.repeat([1, -1], vertices))
    across = np.multiply.outer(R, unit[:, 1])
    normal = axis[:, None, ::-1] * [-1, 1]
    return np.asarray(
        center[:, None] + along[..., None] * axis[:, None] + across[..., None] * normal
    )


def draw(packing: Packing, network: ContactNetwork, title: str, out: Path, dpi: int) -> None:
    """Draw the box and what is in it."""
    from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415
    from matplotlib.colors import LinearSegmentedColormap, to_rgba  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415 - none of these is needed for --help

    box, A, R = packing.box, packing.half_length, packing.radius
    size = np.interp(A + R, [(A + R).min(), (A + R).max()], [0, 1])
    color = LinearSegmentedColormap.from_list("size", [SMALL, BIG])(size)
    grey = find_rattlers(packing, network)
    color[grey & ~grey.all()] = to_rgba(RATTLER)
    scale = INCHES / box.edges.max()
    figure = Figure(figsize=scale * box.edges + MARGIN, layout="constrained")
    axes = figure.subplots()
    line = np.clip(0.05 * 72 * scale * R.min(), 0.1, 1.0)  # points
    dot = np.clip(0.016 / scale, 0.18 * R.min(), 0.5 * R.min())
    i, center = images(packing.position, A[:, None] * np.abs(packing.axes) + R[:, None], box)
    bodies = list(outlines(center, packing.axes[i], A[i], R[i]))
    axes.add_collection(PolyCollection(bodies, facecolors=color[i], edgecolors="k", lw=line))
    half = (np.maximum(A, SHORTEST * R) * (A > 0))[i, None] * packing.axes[i]
    spines = list(np.stack([center - half, center + half], axis=1))
    axes.add_collection(LineCollection(spines, colors="k", lw=1.5 * line))
    i, center = images(network.bonds.point, np.full_like(network.bonds.point, dot), box)
    dots = list(outlines(center, np.eye(2)[0 * i], 0.0, dot))
    axes.add_collection(PolyCollection(dots, facecolors=CONTACT, lw=0))
    xlim, ylim = np.transpose([box.lo, box.lo + box.edges])
    axes.set(xlim=xlim, ylim=ylim, aspect="equal", xticks=[], yticks=[])
    axes.set_title(title, fontsize=9)
    figure.savefig(out, dpi=dpi)


def main() -> None:
    """Read, find the contacts, draw, report."""
    parser = ArgumentParser(description=__doc__, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path, metavar="FILE", help="H5MD file, dump or data file")
    parser.add_argument("--frame", type=int, default=-1, help="negative: from the end (-1)")
    parser.add_argument("--out", type=Path, default=Path("packing.png"), help="(packing.png)")
    sides = "points of a side-to-side contact; auto: as the file says, or else 2 (auto)"
    parser.add_argument("--sides", choices=("auto", "1", "2"), default="auto", help=sides)
    parser.add_argument("--dpi", type=int, default=200, help="dots per inch (200)")
    options = parser.parse_args()
    packing = read_any(options.file, options.frame)
    if packing.shape_style != "spherocylinder":
        msg = f"{options.file}: holds {packing.shape_style!r}, expected 'spherocylinder'"
        raise ValueError(msg)
    if packing.dimension != 2:
        msg = f"{options.file}: is three-dimensional, expected two dimensions; OVITO draws 3D dumps"
        raise ValueError(msg)
    known: dict[str, Any] = {"sides": 2, "k_e": 1.0}
    with contextlib.suppress(FileFormatError):  # dumps and data files have no attributes
        known |= read_attributes(options.file)
    n_sides = known["sides"] if options.sides == "auto" else int(options.sides)
    network = find_contacts(packing, known["k_e"], n_sides)
    z, _, rattlers, _, _ = coordination(packing, network)
    u = float(network.energy.sum()) / packing.box.volume
    title = rf"$N={packing.n}$    $\phi={packing.phi:.5f}$    $u=${u:.1e}    $z={z:.3f}$"
    title += f"    step {packing.step}" * (packing.step > 0)
    draw(packing, network, title, options.out, options.dpi)
    report = {"out": str(options.out), "n": packing.n, "rattlers": rattlers}
    print(json.dumps(report | {"contacts": len(network.pairs), "phi": packing.phi, "u": u, "z": z}))


if __name__ == "__main__":
    try:
        main()
    except (OSError, ValueError) as error:
        sys.exit(f"draw.py: {error}")
