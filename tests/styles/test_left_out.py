"""Log line on skipped work."""

import re

import pytest
from lammps_runs import load_plugin, run_lmp_well, scene
from lammps_scenes import dense
from pair_scenes import packing_of

from jamshape.lammps.session import Session

pytestmark = pytest.mark.lammps

EVERYTHING = "disable_shortcuts rotation pairs contact"
RODS = "pair_style spherocylinder/harmonic sides one"
FLOW = "fix move all overdamped/affine drag 1.0 compress 1e-4"
STEP = "timestep 0.01"
ALWAYS = "energy and virial of steps without output"
DISCS = f"{ALWAYS}, the third dimension, rotations and torques, the contact search for discs"


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
    ("name", "spared"),
    [
        ("rods", f"{ALWAYS}, the third dimension"),
        ("p 1", f"{ALWAYS}, the general contact search for ellipsoids"),
        ("spheres of sizes", f"{ALWAYS}, rotations and torques, the contact search for spheres"),
        ("bodies", None),
    ],
)
def test_each_scene_has_its_own(name, spared, tmp_path):
    packing = packing_of(name)
    with Session() as session:
        session.commands(scene(packing, tmp_path / "s.data"))
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
