"""Draw a packing of 2D spherocylinders or discs (Fig. 7 of the paper below).

    python analysis/draw.py FILE [--frame -1] --out packing.png

FILE is a packing or run of ours (H5MD), a LAMMPS dump or a data file. Particles are blue if big,
green if small, grey if rattlers; black lines are along the spines, and red dots are where they
touch. The last line of standard output is one JSON object with what was counted.

Marschall & Teitel, Phys. Rev. E 97, 012905 (2018).
"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.contacts import ContactNetwork, coordination, find_contacts, find_rattlers
from jamshape.lammps_files import read_any
from jamshape.packing import Box, FloatArray, IntArray, Packing
from jamshape.storage import FileFormatError, read_attributes

SMALL, BIG, RATTLER, CONTACT = "#86c98a", "#6ea6dc", "#cfcfcf", "#d7191c"
INCHES = 7.0  # width or height of the box, whichever is larger
DOT = 0.2  # radius of a contact's dot over the smallest R
SHORTEST = 0.6  # half length of a line along a spine, where A is less, over R


def images(position: FloatArray, reach: FloatArray, box: Box) -> tuple[IntArray, FloatArray]:
    """Find the owners and positions of all periodic images that reach into the box."""
    inside = box.lo + (position - box.lo) % box.edges
    turns = np.ceil(reach.max(axis=0) / box.edges).astype(int)
    found = []
    for shift in np.ndindex(*(2 * turns + 1)):
        moved = inside + (np.array(shift) - turns) * box.edges
        seen = ((moved > box.lo - reach) & (moved < box.lo + box.edges + reach)).all(axis=1)
        found.append((np.flatnonzero(seen), moved[seen]))
    owners, positions = zip(*found, strict=True)
    return np.concatenate(owners), np.concatenate(positions)


def outlines(center: FloatArray, axis: FloatArray, A: ArrayLike, R: ArrayLike) -> FloatArray:
    """Trace spherocylinders: (N, V, 2) vertices; half length and radius may be one number."""
    vertices = int(np.clip(400 / np.sqrt(len(center)), 8, 64))
    angle = np.linspace(-np.pi / 2, np.pi / 2, vertices)
    cap = np.column_stack([np.cos(angle), np.sin(angle)])
    unit = np.concatenate([cap, -cap])
    along = np.multiply.outer(R, unit[:, 0]) + np.multiply.outer(A, np.repeat([1, -1], vertices))
    across = np.multiply.outer(R, unit[:, 1])
    normal = axis[:, ::-1] * [-1, 1]
    xy = along[..., None] * axis[:, None] + across[..., None] * normal[:, None]
    return center[:, None] + xy


def title(packing: Packing, network: ContactNetwork, z: float) -> str:
    """Write what is drawn in one line."""
    words = [rf"$N = {packing.n}$", rf"$\phi = {packing.phi:.4f}$", f"$z = {z:.3f}$"]
    if u := network.energy.sum() / packing.box.volume:
        digits, power = f"{u:.2e}".split("e")
        words.append(rf"$u = {digits} \times 10^{{{int(power)}}}$")
    return "    ".join(words + [f"step {packing.step}"] * (packing.step > 0))


def draw(packing: Packing, network: ContactNetwork, words: str, out: Path) -> None:
    """Draw the box and what is in it."""
    from matplotlib.collections import LineCollection, PolyCollection  # noqa: PLC0415
    from matplotlib.colors import LinearSegmentedColormap, to_rgba  # noqa: PLC0415
    from matplotlib.figure import Figure  # noqa: PLC0415 - none of them needed for --help

    box, A, R = packing.box, packing.half_length, packing.radius
    size = (A + R - (A + R).min()) / (np.ptp(A + R) or 1.0) if np.ptp(A + R) else np.ones(packing.n)
    color = LinearSegmentedColormap.from_list("size", [SMALL, BIG])(size)
    color[find_rattlers(packing, network)] = to_rgba(RATTLER)
    width, height = box.edges * INCHES / box.edges.max()
    figure = Figure(figsize=(width + 0.3, height + 0.5), dpi=200)
    axes = figure.add_axes((0.15 / (width + 0.3), 0.15 / (height + 0.5), width / (width + 0.3), height / (height + 0.5)))
    points = 72 * INCHES / box.edges.max() * R.min()  # of the smallest radius

    i, center = images(packing.position, A[:, None] * np.abs(packing.axes) + R[:, None], box)
    shapes = outlines(center, packing.axes[i], A[i], R[i])
    line = np.clip(0.05 * points, 0.12, 1.0)
    axes.add_collection(PolyCollection(shapes, facecolors=color[i], edgecolors="k", linewidths=line))
    rods = A[i] > 0
    half = np.maximum(A, SHORTEST * R)[i, None] * packing.axes[i]
    spines = np.stack([center - half, center + half], axis=1)[rods]
    axes.add_collection(LineCollection(spines, colors="k", linewidths=1.5 * line))
    dot = np.full((len(network.bonds.point), 2), DOT * R.min())
    if len(dot):
        _, center = images(network.bonds.point, dot, box)
        dots = outlines(center, np.tile([1.0, 0.0], (len(center), 1)), 0.0, dot[0, 0])
        axes.add_collection(PolyCollection(dots, facecolors=CONTACT, linewidths=0))
    axes.set(xticks=[], yticks=[])
    axes.set(xlim=box.lo[0] + [0, box.edges[0]], ylim=box.lo[1] + [0, box.edges[1]])
    axes.set_title(words, fontsize=9)
    figure.savefig(out)
