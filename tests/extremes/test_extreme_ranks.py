"""LAMMPS on two ranks: results do not depend on how the box is divided."""

import numpy as np
from extreme import case, extreme
from extreme_in_lammps import WORDS, fix
from extreme_shapes import SHAPES
from lammps_runs import dump, load_plugin, run_lmp_well, scene, states_from_dump
from lammps_scenes import pose_differences


def on_ranks(ranks, packing, drive, sides, folder):
    """State after a run."""
    path = folder / str(ranks)
    text = f"""{load_plugin()}
        {scene(packing, f"{path}.data", sides=WORDS[sides])}
        {fix(drive.kappa, drive.dt) if drive.steps else ""}
        {dump(f"{path}.dump", max(drive.steps, 1))}
        run {drive.steps}"""
    run_lmp_well(text, folder, ranks)
    return states_from_dump(f"{path}.dump", packing)[-1]


@extreme("change of poses and forces", [
    # Particles that touch their own images are on two ranks in tests/styles/test_pair_styles.py, too.
    case(f"two ranks: {shape.name}, {name}", drive, shape.laws[-1].sides, heavy=name == "own images")
    for shape in SHAPES for name, drive in shape.two_ranks.items()
], 1e-12)  # fmt: skip
def test_two_ranks(drive, sides, tmp_path):
    """Of poses over the box edge, of forces and torques over the largest."""
    packing = drive.scene()
    one, two = (on_ranks(ranks, packing, drive, sides, tmp_path) for ranks in (1, 2))
    worst = list(pose_differences(one, two))
    for name in ("force", "torque"):
        here, there = getattr(one, name), getattr(two, name)
        worst.append(np.abs(there - here).max() / (np.abs(here).max() or 1.0))
    return max(worst)
