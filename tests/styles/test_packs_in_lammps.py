"""Pair styles with every set of instructions: the forces of one pair at a time, and the same dynamics."""

import numpy as np
import pytest
from lammps_scenes import (
    dense,
    dense_mixture,
    dump,
    load_plugin,
    pose_differences,
    run_lmp,
    run_lmp_well,
    scene,
    states_from_dump,
)
from superellipsoid_scenes import crowd
from superellipsoid_scenes import scene as scene_of_superellipsoids

from jamshape import _contact

pytestmark = pytest.mark.lammps

PACKS = [name for name in _contact.instruction_sets() if name != "scalar"]
FLOW = "fix move all overdamped/affine drag 1.0 compress 1e-4\ntimestep 0.01"
SCENES = {
    "discs": lambda: dense(alpha=0.0),
    "rods": dense,
    "mixture": dense_mixture,
    "rods in space": lambda: dense(3),
    "spheroids": lambda: crowd(kinds=(1,)),
    "spheres": lambda: crowd(kinds=(2,)).with_(exponent=np.ones(48)),
    "superballs": lambda: crowd(kinds=(2,)).with_(exponent=np.full(48, 1.5)),
    "rounded octahedra": lambda: crowd(kinds=(2,)).with_(exponent=np.full(48, 0.8)),
    "all exponents": crowd,
}


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("sides", ["one", "two"])
@pytest.mark.parametrize("name", SCENES)
def test_forces_do_not_depend_on_the_instructions(name, sides, ranks, tmp_path, monkeypatch):
    packing = SCENES[name]()
    is_rods = packing.shape.name == "spherocylinder"
    if not is_rods and sides == "one":
        pytest.skip("no sides")
    data, newton = tmp_path / "s.data", "on" if ranks == 1 else "off"
    if is_rods:
        text = scene(packing, data, newton=newton, sides=sides)
    else:
        text = scene_of_superellipsoids(packing, data, newton=newton)
    ends = []
    for instructions in ("scalar", *PACKS):
        monkeypatch.setenv("JAMSHAPE_SIMD", instructions)
        path = tmp_path / f"{instructions}.dump"
        run_lmp_well(f"{load_plugin()}\n{text}\n{dump(path, 20)}\n{FLOW}\nrun 20", tmp_path, ranks)
        ends.append(states_from_dump(path, None if is_rods else packing.exponent))
    (start, end), *others = ends
    largest = np.abs(start.force).max()
    assert largest > 0
    # Near faces a torque is known to the root of what the tangency is.
    rounding = 1e-14 if is_rods or np.all(packing.exponent == 1.0) else 1e-11
    for start_there, end_there in others:
        assert np.abs(start.force - start_there.force).max() < rounding * largest
        assert np.abs(start.torque - start_there.torque).max() < rounding * largest
        assert max(pose_differences(end, end_there)) < max(1e-12, rounding)


def test_a_set_that_this_machine_has_not_is_refused(tmp_path, monkeypatch):
    text = scene(dense(), tmp_path / "s.data")  # in this process, which LAMMPS would end
    monkeypatch.setenv("JAMSHAPE_SIMD", "mmx")
    done = run_lmp(f"{load_plugin()}\n{text}\nrun 0", tmp_path)
    assert done.returncode != 0
    assert "found JAMSHAPE_SIMD=mmx, expected no value or scalar" in done.stdout
