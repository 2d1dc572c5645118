"""LAMMPS on two ranks: results do not depend on how the box is divided."""

import numpy as np
from extreme import case, extreme
from extreme_in_lammps import fix
from extreme_shapes import SHAPES
from in_lammps import scene
from lammps_scenes import run_lmp_well

from jamshape.shapes.shape import Interaction

COLUMNS = "id x y z quatw quati quatj quatk fx fy fz tqx tqy tqz"


def on_ranks(ranks, packing, drive, sides, folder):
    """Poses, forces and torques after a run, sorted by ID."""
    data = folder / f"{ranks}.data"
    text = f"""{scene(packing, data, Interaction(1.0, sides))}
        undump forces
        {fix(drive.kappa, drive.dt) if drive.steps else ""}
        compute seen all property/atom {COLUMNS}
        dump ends all custom {max(drive.steps, 1)} {data}.end c_seen[*]
        dump_modify ends format float %.17g
        run {drive.steps}"""
    run_lmp_well(text, folder, ranks)
    rows = (folder / f"{ranks}.data.end").read_text().splitlines()[-packing.n :]
    table = np.array([row.split() for row in rows], float)
    return table[table[:, 0].argsort()]


@extreme("change of poses and forces", [
    case(f"two ranks: {shape.name}, {name}", drive, shape.laws[-1].sides)
    for shape in SHAPES for name, drive in shape.two_ranks.items()
], 1e-12)  # fmt: skip
def test_two_ranks(drive, sides, tmp_path):
    """Of poses over the box edge, of forces and torques over the largest."""
    packing = drive.scene()
    one, two = (on_ranks(ranks, packing, drive, sides, tmp_path) for ranks in (1, 2))
    shift = (one[:, 1:4] - two[:, 1:4]) / np.append(packing.box.edges, 1.0)[:3]
    change = np.abs(one - two)
    worst = [np.abs(shift - np.round(shift)).max(), change[:, 4:8].max()]
    parts = (slice(8, 11), slice(11, 14))
    worst += [change[:, own].max() / (np.abs(one[:, own]).max() or 1.0) for own in parts]
    return max(worst)
