"""Pair styles with every set of instructions: the forces of one pair at a time, and the same dynamics."""

import itertools
import os
from functools import cache
from unittest import mock

import numpy as np
import pytest
from lammps_runs import dump, load_plugin, run_lmp, run_lmp_well, scene, states_from_dump
from lammps_scenes import dense, dense_mixture, pose_differences
from once import made_once
from superellipsoid_scenes import crowd

import jamshape as js
from jamshape import _contact

pytestmark = pytest.mark.lammps

PACKS = [name for name in _contact.instruction_sets() if name != "scalar"]
FLOW = "fix move all overdamped/affine drag 1.0 compress 1e-4\ntimestep 0.01"


@cache
def squares():
    """Overlapping, and out of balance."""
    shape = js.Spheropolygons(rounding=0.3)
    packing = js.make_packing(shape, n=48, seed=1, u0=1e-6, progress=False)
    return packing.with_(diameters=1.03 * packing.diameters)


SCENES = {
    "discs": lambda: dense(alpha=0.0),
    "rods": dense,
    "mixture": dense_mixture,
    "rods in space": lambda: dense(3),
    "squares": squares,
    "spheroids": lambda: crowd(kinds=(1,)),
    "spheres": lambda: crowd(kinds=(2,)).with_(exponent=np.ones(48)),
    "superballs": lambda: crowd(kinds=(2,)).with_(exponent=np.full(48, 1.5)),
    "rounded octahedra": lambda: crowd(kinds=(2,)).with_(exponent=np.full(48, 0.8)),
    "all exponents": crowd,
}
CASES = [(name, "two") for name in SCENES]
CASES += [(name, "one") for name in ("discs", "rods", "mixture", "rods in space", "squares")]

# Two ranks wait for each other for most of their time: there one case of each kind of particle, and the widest packs.
ON_TWO_RANKS = [
    ("mixture", "two"),
    ("rods in space", "one"),
    ("squares", "two"),
    ("all exponents", "two"),
]


def marked(case, instructions, ranks):
    is_quick = ranks == 1 or (case in ON_TWO_RANKS and instructions == PACKS[-1])
    return pytest.param(case, instructions, ranks, marks=() if is_quick else pytest.mark.validate,
                        id="-".join((*case, instructions, str(ranks))))  # fmt: skip


@pytest.fixture(scope="module")
def found_with(tmp_path_factory, request):
    """States of a case at the start and after 20 steps; a set of instructions has a process for all cases."""
    params = (getattr(item, "callspec", None) for item in request.session.items)
    own = {"case", "instructions", "ranks"}
    asked = [of.params for of in params if of and own <= of.params.keys()]

    @cache
    def run(instructions, ranks):
        cases = {of["case"] for of in asked if of["ranks"] == ranks}

        def fill(folder):
            newton, text = "on" if ranks == 1 else "off", ""
            for k, (name, sides) in enumerate(CASES):
                if (name, sides) in cases:
                    start = scene(SCENES[name](), folder / f"{k}.data", newton=newton, sides=sides)
                    states = dump(folder / f"{k}.dump", 20)
                    text += f"clear\n{load_plugin()}\n{start}\n{states}\n{FLOW}\nrun 20\n"
            with mock.patch.dict(os.environ, JAMSHAPE_SIMD=instructions):
                run_lmp_well(text, folder, ranks)

        return made_once(tmp_path_factory, f"packs_{instructions}_{ranks}", fill)

    def found(case, instructions, ranks):
        path = run(instructions, ranks) / f"{CASES.index(case)}.dump"
        return states_from_dump(path, SCENES[case[0]]())

    return found


@pytest.mark.parametrize(
    ("case", "instructions", "ranks"),
    [marked(*each) for each in itertools.product(CASES, PACKS, (1, 2))],
)
def test_forces_do_not_depend_on_the_instructions(case, instructions, ranks, found_with):
    packing = SCENES[case[0]]()
    start, end = found_with(case, "scalar", ranks)
    start_there, end_there = found_with(case, instructions, ranks)
    largest = np.abs(start.force).max()
    assert largest > 0
    # Near faces a torque is known to the root of what the tangency is.
    rounding = 1e-14 if np.all(packing.exponent == 1.0) else 1e-11
    assert np.abs(start.force - start_there.force).max() < rounding * largest
    assert np.abs(start.torque - start_there.torque).max() < rounding * largest
    assert max(pose_differences(end, end_there)) < max(1e-12, rounding)


def test_a_set_that_this_machine_has_not_is_refused(tmp_path, monkeypatch):
    text = scene(dense(), tmp_path / "s.data")  # in this process, which LAMMPS would end
    monkeypatch.setenv("JAMSHAPE_SIMD", "mmx")
    done = run_lmp(f"{load_plugin()}\n{text}\nrun 0", tmp_path)
    assert done.returncode != 0
    assert "found JAMSHAPE_SIMD=mmx, expected no value or scalar" in done.stdout
