"""What a scene leaves out: the line in the log, and the same results with all of it turned back on."""

import re

import numpy as np
import pytest
from lammps_scenes import (
    dense,
    dump,
    load_plugin,
    pose_differences,
    run_lmp_well,
    scene,
    states_from_dump,
)
from superellipsoid_scenes import crowd
from superellipsoid_scenes import scene as scene_of_superellipsoids

from jamshape.lammps.session import Session

pytestmark = pytest.mark.lammps

EVERYTHING = "general rotation pairs contact"
RODS = "pair_style spherocylinder/harmonic sides one"
OTHERS = "pair_style superellipsoid/harmonic"
FLOW = "fix move all overdamped/affine drag 1.0 compress 1e-4"
STEP = "timestep 0.01"
ALWAYS = "energy and virial of steps without output"
DISCS = f"{ALWAYS}, the third dimension, rotations and torques, the contact search for discs"


def spheroids():
    return crowd(kinds=(1,))


def spheres():
    return crowd(kinds=(2,)).with_(exponent=np.ones(48))


def lines_in(log, style):
    return re.findall(
        rf"^{style}: skipped, because this run does not need it: (.*)$", log, re.MULTILINE
    )


def test_the_log_tells_it_once(tmp_path):
    text = f"""{load_plugin()}
        {scene(dense(alpha=0.0), tmp_path / "s.data")}
        {FLOW}
        {STEP}
        run 2
        run 2"""
    log = run_lmp_well(text, tmp_path)
    (line,) = lines_in(log, "pair_style spherocylinder/harmonic")
    assert re.fullmatch(rf"{DISCS}, \d+ % of the listed pairs", line)
    assert lines_in(log, "fix overdamped/affine") == [
        "energy and virial of stages within steps, second derivatives"
    ]
    # The share of pairs is of all ranks; how LAMMPS lists pairs across them is its own.
    of_two = run_lmp_well(text, tmp_path, ranks=2)
    (line,) = lines_in(of_two, "pair_style spherocylinder/harmonic")
    assert line.startswith(DISCS)


@pytest.mark.parametrize(
    ("make", "style", "spared"),
    [
        (dense, RODS, f"{ALWAYS}, the third dimension"),
        (spheroids, OTHERS, f"{ALWAYS}, the general contact search for ellipsoids"),
        (spheres, OTHERS, f"{ALWAYS}, rotations and torques, the contact search for spheres"),
        (crowd, OTHERS, None),
    ],
)
def test_each_scene_has_its_own(make, style, spared, tmp_path):
    packing = make()
    write = scene if style is RODS else scene_of_superellipsoids
    with Session() as session:
        session.commands(write(packing, tmp_path / "s.data"))
        assert session.left_out() == ""
        session.commands("run 0")
        found = session.left_out()
    if spared is None:  # spheres of an exponent of their own, and ellipsoids among others
        spared = f"{ALWAYS}, the general contact search for ellipsoids"
    assert re.sub(r", \d+ % of the listed pairs", "", found) == spared
    assert "listed pairs" in found


def test_what_is_turned_back_on_is_not_left_out(tmp_path):
    text = scene(dense(alpha=0.0), tmp_path / "s.data").replace(RODS, f"{RODS} {EVERYTHING}")
    log = run_lmp_well(f"{load_plugin()}\n{text}\nrun 0", tmp_path)
    assert lines_in(log, "pair_style spherocylinder/harmonic") == [f"{ALWAYS}, the third dimension"]


@pytest.mark.parametrize("what", ["rotation", "pairs", "contact", "rotation pairs contact"])
@pytest.mark.parametrize("name", ["discs", "rods", "spheroids", "spheres"])
def test_results_are_the_same_to_rounding(name, what, tmp_path):
    """Forces at the start, and where the dynamics lead in fifty steps."""
    packing = {
        "discs": lambda: dense(alpha=0.0),
        "rods": dense,
        "spheroids": spheroids,
        "spheres": spheres,
    }[name]()
    style = RODS if name in ("discs", "rods") else OTHERS
    write = scene if style is RODS else scene_of_superellipsoids
    ends = []
    for general in ("", f" general {what}"):
        path = tmp_path / f"s{len(ends)}.dump"
        text = write(packing, tmp_path / "s.data").replace(style, style + general)
        run_lmp_well(f"{load_plugin()}\n{text}\n{dump(path, 50)}\n{FLOW}\n{STEP}\nrun 50", tmp_path)
        ends.append(states_from_dump(path, None if style is RODS else np.ones(1)))
    (start, end), (start_there, end_there) = ends
    largest = np.abs(start.force).max()
    assert largest > 0
    assert np.abs(start.force - start_there.force).max() < 1e-13 * largest
    assert np.abs(start.torque - start_there.torque).max() < 1e-13 * largest
    assert max(pose_differences(end, end_there)) < 1e-12
