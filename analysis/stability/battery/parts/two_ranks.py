"""Cases of the stability battery: LAMMPS on two ranks, whose results must not depend on how the box is divided."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

import numpy as np

from battery.case import Case
from battery.session import Setting, fix, run_alone, set_up
from battery.shapes.shape import Drive
from battery.shapes.table import SHAPES
from jamshape.arrays import FloatArray

_COLUMNS = "id x y z quatw quati quatj quatk fx fy fz tqx tqy tqz"


def on_ranks(ranks: int, drive: Drive, sides: int) -> FloatArray:
    """Poses, forces and torques after a run in a process of its own, sorted by ID."""
    packing = drive.scene()
    flow = fix(drive.kappa, drive.dt) if drive.steps else ""
    with tempfile.TemporaryDirectory() as folder:
        dump = Path(folder) / "end.dump"
        text = f"""{set_up(packing, Setting(sides))}
            {flow}
            compute seen all property/atom {_COLUMNS}
            dump ends all custom {max(drive.steps, 1)} {dump} c_seen[*]
            dump_modify ends format float %.17g
            run {drive.steps}"""
        run_alone(packing, text, Path(folder), ranks)
        rows = dump.read_text().splitlines()[-packing.n :]
    table = np.array([row.split() for row in rows], float)
    return np.asarray(table[table[:, 0].argsort()])


def ranks_differ(drive: Drive, sides: int) -> float:
    """Change of poses over the box edge, and of forces and torques over the largest, by a second rank."""
    one, two = (on_ranks(ranks, drive, sides) for ranks in (1, 2))
    edges = np.append(drive.scene().box.edges, 1.0)[:3]
    shift = (one[:, 1:4] - two[:, 1:4]) / edges
    change = np.abs(one - two)
    worst = [np.abs(shift - np.round(shift)).max(), change[:, 4:8].max()]
    parts = (slice(8, 11), slice(11, 14))
    worst += [change[:, own].max() / (np.abs(one[:, own]).max() or 1.0) for own in parts]
    return float(max(worst))


def cases() -> list[Case]:
    """All of them."""
    found = []
    for shape in SHAPES:
        for name, drive in shape.two_ranks.items():
            run = partial(ranks_differ, drive, shape.laws[-1].sides)
            label = f"{shape.name}, {name}"
            found.append(Case("two ranks", label, "change of poses and forces", 1e-12, run))
    return found
