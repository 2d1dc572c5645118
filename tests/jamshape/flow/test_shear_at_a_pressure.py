"""Shear at a constant normal pressure, to one side and to and fro."""

from __future__ import annotations

import json

import numpy as np
import pytest
from in_process import jamshape

import jamshape as js

pytestmark = pytest.mark.lammps

DISCS = js.Spherocylinders(alpha=0)


def test_the_normal_pressure_is_held_and_the_height_follows(tmp_path):
    run = js.shear(DISCS, n=32, phi=0.8, gdot=1e-2, strain=4, pressure=1e-2, t_box=5.0, rows=200,
                   file=tmp_path / "run.h5", progress=False)  # fmt: skip
    found = run.steady(after=1.0)
    assert found["p_yy"].value == pytest.approx(1e-2, rel=0.1)
    assert 0.05 < found["friction"].value < 1
    assert found["friction"].value == pytest.approx(
        found["shear_stress"].value / found["p_yy"].value
    )
    assert found["phi"].value == pytest.approx(run["phi"].mean(), rel=0.05)
    assert run["phi"].std() > 0
    assert run.strain[-1] == pytest.approx(4, rel=1e-9)
    np.testing.assert_allclose(run["p_yy"], run["pressure"] - run["normal_difference"] / 2)
    assert run.about["hold_pressure"] == 1e-2


def test_the_default_time_does_not_decide_how_the_height_follows(tmp_path, measured):
    """A faster box gives the same phi; one with 0.01 / gdot would not have followed at this rate and pressure."""
    how = {"n": 64, "phi": 0.8, "gdot": 1e-4, "strain": 0.1, "pressure": 1e-4, "rows": 20, "progress": False}  # fmt: skip
    usual = js.shear(DISCS, file=tmp_path / "usual.h5", **how)
    time = usual.about["box_time"]
    fast, slow = (js.shear(DISCS, t_box=factor * time, **how) for factor in (0.1, 60))
    change = fast.phi[-1] - fast.phi[0]
    measured(fast=abs((usual.phi - fast.phi) / change).max())
    assert np.abs(usual.phi - fast.phi).max() < 0.15 * abs(change)
    assert np.abs(slow.phi - fast.phi).max() > 0.6 * abs(change)
    assert usual.about["relaxation_time"] == pytest.approx(usual.packing().measures.mean() * 4 / np.pi / 1e-4, rel=1e-6)  # fmt: skip


def test_a_volume_that_is_held_records_what_it_did(tmp_path):
    run = js.shear(DISCS, n=24, phi=0.8, gdot=1e-2, strain=0.2, rows=10, file=tmp_path / "run.h5", progress=False)  # fmt: skip
    assert "p_yy" not in run.observables
    assert "hold_pressure" not in run.about


@pytest.mark.parametrize("shear", [js.shear, js.cyclic_shear])
@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"t_box": 10.0}, "t_box=10.0 has no effect with pressure=0.0"),
        ({"pressure": 1e-3, "flow": "pure"}, "flow='pure' shear drives the height of the box"),
        ({"pressure": -1e-3}, "expected"),
        ({"pressure": 1e-3, "t_box": 0.0}, "expected"),
    ],
)
def test_what_a_pressure_cannot_go_with_is_refused(arguments, sentence, shear, tmp_path):
    if shear is js.cyclic_shear and "integrator" in arguments:
        sentence = "expected"
    with pytest.raises(ValueError, match=sentence):
        shear(DISCS, n=24, file=tmp_path / "run.h5", progress=False, **arguments)


@pytest.mark.parametrize("shear", [js.shear, js.cyclic_shear])
def test_the_file_of_another_pressure_or_of_none_is_refused(shear, tmp_path):
    how = {"n": 8, "phi": 0.7, "rows": 8, "file": tmp_path / "run.h5", "progress": False}
    how |= (
        {"gdot": 1e-2, "strain": 0.1}
        if shear is js.shear
        else {"amplitude": 0.02, "period": 40, "cycles": 1}
    )
    shear(DISCS, pressure=1e-2, t_box=5.0, **how)
    for other in ({}, {"pressure": 2e-2, "t_box": 5.0}):
        with pytest.raises(ValueError, match=r"with pressure=0\.01, expected"):
            shear(DISCS, **how, **other)


# --- to and fro ----------------------------------------------------------------------------------

BODIES = js.Superellipsoids(w1=0.6)
SCENES = {2: (js.Spherocylinders(alpha=1), 0.86), 3: (BODIES, 0.66)}


def cyclic(particles, **how):
    usual = {"n": 16, "amplitude": 0.03, "period": 120, "cycles": 3, "t_box": 5.0, "progress": False}  # fmt: skip
    return js.cyclic_shear(particles, **usual | how)


@pytest.mark.parametrize("dimension", [2, 3])
def test_work_of_stress_and_pressure_is_stored_or_dissipated(dimension, tmp_path, measured):
    particles, phi = SCENES[dimension]
    run = cyclic(particles, dimension=dimension, phi=phi, pressure=2e-2, rows=400, cycles=1, file=tmp_path / "a.h5")  # fmt: skip
    volume, apart = run.phi[0] / run.phi, run.about["period"] / run.about["rows"]
    defects, without = [], []
    for cycle in run.cycles():
        rows = slice(400 * (cycle.number - 1), 400 * cycle.number + 1)
        V = volume[rows] / volume[rows][0]
        rise, spin = np.diff(run["u"][rows] * V), (run["torque_power"][rows] * V).copy()
        stored = rise.sum() + np.trapezoid(spin, dx=apart)
        defects.append((cycle.work - cycle.lost - stored) / cycle.lost)
        pressed = np.trapezoid(run["p_yy"][rows], V) / cycle.lost
        without.append(defects[-1] + pressed)
    measured(balance=np.abs(defects).max(), without_pressure=np.abs(without).max())
    assert np.abs(defects).max() < 2e-3
    assert np.abs(without).max() > 2e-2  # the work of the pressure matters


def test_the_pressure_is_held_to_and_fro_and_the_width_stays(tmp_path):
    run = cyclic(DISCS, n=32, phi=0.8, pressure=1e-2, cycles=4, rows=100, file=tmp_path / "a.h5")
    assert run["p_yy"][200:].mean() == pytest.approx(1e-2, rel=0.05)
    assert run.phi.std() > 1e-3
    np.testing.assert_allclose(run.strain[::100], 0, atol=1e-15)
    np.testing.assert_allclose(run.strain[25::100], 0.03, rtol=1e-12)
    edges = np.array([frame.box.edges for frame in run])
    np.testing.assert_allclose(edges[:, 0], edges[0, 0], rtol=1e-14)
    assert np.abs(edges[1:, 1] / edges[0, 1] - 1).max() > 1e-3
    assert repr(run).startswith(
        "<Cyclic shear of 32 spherocylinders in 2D at p_yy = 0.01: 4 cycles"
    )
    assert "p_{yy}=10^{-2}" in run.plot().get_title()


@pytest.mark.parametrize("dimension", [2, 3])
def test_displacements_are_beside_the_deformation_of_the_box(dimension, tmp_path):
    """At small strains, where cell vectors stay, it is that from the first ones to those of a frame."""
    particles, phi = SCENES[dimension]
    run = cyclic(particles, dimension=dimension, phi=phi, pressure=2e-2, rows=40, file=tmp_path / "a.h5")  # fmt: skip
    start = run.packing(0).box
    places = []
    for frame in run:
        offset = frame.position + frame.image @ frame.box.matrix.T - frame.box.center
        places.append(offset @ np.linalg.inv(frame.box.matrix @ np.linalg.inv(start.matrix)).T)
    moved = (np.diff(places, axis=0) ** 2).sum(axis=2).mean(axis=1)
    np.testing.assert_allclose(run.displacement, moved, rtol=1e-9)


def test_a_box_that_takes_other_cell_vectors_moves_no_particle(tmp_path):
    run = cyclic(DISCS, n=16, phi=0.8, amplitude=0.7, period=1400, cycles=2, pressure=1e-2, rows=400,
                 file=tmp_path / "a.h5")  # fmt: skip
    edge = run.packing(0).box.edges[0]
    jumps = np.abs(np.diff(np.sqrt(run["displacement"])))
    jumps[400::400] = 0  # where a cycle begins
    assert jumps.max() < 0.05 * edge


def test_the_command_cycles_at_a_pressure(tmp_path):
    file = tmp_path / "a.h5"
    words = ("cycle", "--alpha", 0, "--n", 12, "--phi", 0.8, "--amplitude", 0.02, "--period", 40, "--cycles", 2,
             "--rows", 8, "--pressure", 1e-2, "--out", file)  # fmt: skip
    said = jamshape(*words).out
    assert len(json.loads(said.splitlines()[-1])["per_cycle"]) == 2
    assert jamshape(*words).out == said
    said = jamshape("info", file).out
    assert "at pressure 0.01, where the box relaxes in 1.7" in said
    assert "and packings in about 148" in said
