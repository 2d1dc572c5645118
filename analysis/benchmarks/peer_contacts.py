"""Contacts of LAMMPS's own superellipsoids, `pair_style granular/superellipsoid`, compared with jamshape's, on the same pairs.

    python analysis/benchmarks/peer_contacts.py
    python analysis/benchmarks/peer_contacts.py --pairs 4000 --exponents 2 2 4 2

With a LAMMPS from 30Mar2026 on, whose atoms have exponents n1 and n2 of 2 or more. Both styles take two bodies for touching
where their insides meet. If n1 and n2 are the same for both, both also put the contact at the same point: where the common
value of their shape functions is least, which ours takes to the power 1/n1, is where bodies that shrink by one factor touch.
Forces then have one direction and one lever arm, while their magnitudes are those of two laws. Pairs of random axes,
orientations and distances are compared, in their forces, torques over forces, and whether they touch:

  differ     pairs that touch for one of the two alone
  angle      between both forces: median and largest over the touching pairs
  arm        difference of the torques of the first body over its force, in units of its mean diameter: the same

Writes a table; the last line of output is a JSON object.
"""

from __future__ import annotations

import tempfile
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.command import parser_of, plain, report, run
from jamshape.files.lammps_text import write_data
from jamshape.lammps.session import Session
from jamshape.packing import Box, Packing

EXPONENTS = (2.0, 2.0, 3.0, 3.0, 4.0, 4.0, 8.0, 8.0, 8.0, 2.0)  # n1 and n2
OURS = "superellipsoid/harmonic\npair_coeff * * 1.0 {n1} {n2}"
THEIRS = "granular/superellipsoid\npair_coeff * * hooke 1.0 0.0 tangential classic 0.0 0.0 0.0 damping mass_velocity"
APART = 4.0  # between the pairs of a grid


def pairs_of(n: int, form: FloatArray, seed: int) -> Packing:
    """Return pairs far apart: 2k and 2k + 1 for each k, of mean diameter 1, some touching."""
    rng = np.random.default_rng(seed)
    rows = int(np.ceil(n ** (1 / 3)))
    grid = APART * (np.stack(np.meshgrid(*[np.arange(rows)] * 3), axis=-1).reshape(-1, 3)[:n] + 0.5)
    towards = rng.normal(size=(n, 3))
    towards *= rng.uniform(0.7, 1.5, (n, 1)) / np.linalg.norm(towards, axis=1, keepdims=True)
    turn = rng.normal(size=(2 * n, 4))
    axes = rng.uniform(0.7, 1.3, (2 * n, 3))
    return Packing(
        position=np.stack([grid, grid + towards], axis=1).reshape(-1, 3),
        orientation=turn / np.linalg.norm(turn, axis=1, keepdims=True),
        diameters=3 * axes / axes.sum(axis=1, keepdims=True),
        species=np.ones(2 * n, int),
        id=1 + np.arange(2 * n),
        box=Box(lo=np.zeros(3), edges=np.full(3, rows * APART)),
        shape_style="superellipsoid",
        form=np.tile(form, (2 * n, 1)),
    )


def forces_of(packing: Packing, style: str) -> tuple[FloatArray, FloatArray]:
    """Return forces and torques (N, 3) of a pair style."""
    with tempfile.TemporaryDirectory() as folder, Session() as session:
        data = Path(folder) / "pairs.data"
        write_data(data, packing, blocks=True)
        session.commands(
            "atom_style ellipsoid superellipsoid\nnewton off\natom_modify map array\n"
            f"comm_modify vel yes\nread_data {data}\npair_style {style}\nrun 0"
        )
        atoms = {
            name: session.lmp.numpy.extract_atom(name)[: packing.n]
            for name in ("id", "f", "torque")
        }
        order = np.argsort(atoms["id"])
        return atoms["f"][order], atoms["torque"][order]


def compared(packing: Packing) -> dict[str, Any]:
    """Compare the first bodies of the pairs."""
    n1, n2 = packing.form[0]
    force, torque = forces_of(packing, OURS.format(n1=n1, n2=n2))
    other, turn = forces_of(packing, THEIRS)
    ours, theirs = (np.linalg.norm(x[::2], axis=1) for x in (force, other))
    both, differ = (ours > 0) & (theirs > 0), (ours > 0) != (theirs > 0)
    row = {
        "n1": n1,
        "n2": n2,
        "pairs": len(ours),
        "touching": int(both.sum()),
        "differ": int(differ.sum()),
    }
    there: dict[str, Any] = {}
    normal, direction = (
        x[::2][both] / size[both, None] for x, size in ((force, ours), (other, theirs))
    )
    angle = 2 * np.arcsin(np.minimum(1, np.linalg.norm(normal - direction, axis=1) / 2))
    arms = torque[::2][both] / ours[both, None] - turn[::2][both] / theirs[both, None]
    arm = np.linalg.norm(arms, axis=1)
    for name, x in (("angle", angle), ("arm", arm)):
        there |= {f"{name}, median": float(np.median(x)), f"{name}, largest": float(x.max())}
    return row | there


def parser() -> ArgumentParser:
    """Make the parser of the command line."""
    found = parser_of(__doc__)
    found.add_argument("--pairs", type=int, default=1000, help="for each shape (1000)")
    found.add_argument("--seed", type=int, default=1, help="(1)")
    found.add_argument(
        "--exponents",
        nargs="+",
        type=float,
        default=EXPONENTS,
        metavar="N",
        help="n1 n2 of each shape",
    )
    return found


def main(options: Namespace) -> None:
    """Compare, and print a table."""
    forms = np.reshape(options.exponents, (-1, 2))
    rows = [compared(pairs_of(options.pairs, form, options.seed)) for form in forms]
    names = list(rows[0])
    print(f"| {' | '.join(names)} |\n|{' --- |' * len(names)}")
    for row in rows:
        print(
            "| "
            + " | ".join(f"{x:.2g}" if isinstance(x, float) else str(x) for x in row.values())
            + " |"
        )
    report(plain({"rows": rows}))


if __name__ == "__main__":
    run(parser(), main)
