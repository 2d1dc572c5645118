"""Minimisation of states of one's own: at rest by an independent sum of forces, at the same box, under the same law."""

import numpy as np
import pytest
from in_process import jamshape

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.landscape import Landscape, State
from jamshape.protocols import stages
from jamshape.protocols.random_start import random_packing

SHAPES = {
    "rods": (js.Spherocylinders(alpha=1), 2, 0.95),
    "discs": (js.Spherocylinders(alpha=0), 2, 0.9),
    "dimers": (js.Dimers(alpha=1), 2, 0.95),
    "bodies": (js.Superellipsoids(w1=0.6), 3, 0.78),
    "superellipses": (js.Superellipsoids(p=2), 2, 0.95),
}


def pressed(name, law=None):
    """A start without overlaps, with its box made smaller: overlaps everywhere."""
    particles, dimension, phi = SHAPES[name]
    start = random_packing(24, 0.4 if dimension == 2 else 0.2, 1, particles, dimension)
    factor = (start.phi / phi) ** (1 / dimension)
    box = js.Box(lo=start.box.lo * factor, edges=start.box.edges * factor)
    more = {} if law is None else {"law": law}
    return start.with_(position=start.position * factor, box=box, **more)


@pytest.mark.parametrize("name", SHAPES)
def test_forces_balance_at_the_same_box(name):
    start = pressed(name)
    found = js.minimise(start, progress=False)
    assert found.reached
    assert found.results["outcome"] in {"converged", "kink"}
    assert np.array_equal(found.box.matrix, start.box.matrix)
    assert np.array_equal(found.box.lo, start.box.lo)
    assert (found.diameters == start.diameters).all()
    assert (found.id == start.id).all()
    evaluation = Landscape(found).evaluate(State.of(found))
    if found.results["outcome"] == "converged":
        assert np.abs(evaluation.gradient).max() <= 1e-8 * evaluation.bond_force
    assert 0 < evaluation.energy < Landscape(start).evaluate(State.of(start)).energy


def test_the_law_of_the_state_is_kept():
    soft = js.minimise(pressed("rods", js.Interaction(0.25, 2)), progress=False)
    hard = js.minimise(pressed("rods"), progress=False)
    assert soft.law.k_e == 0.25
    assert soft.u == pytest.approx(0.25 * hard.u, rel=1e-6)


def test_a_state_without_contacts_is_unjammed():
    found = js.minimise(random_packing(12, 0.3, 1), progress=False)
    assert (found.results["outcome"], found.u, found.reached) == ("unjammed", 0.0, True)
    assert js.minimise(random_packing(12, 0.3, 1), strict=True, progress=False).reached


def test_a_strict_minimum_has_no_negative_modes_at_the_same_box():
    start = js.make_packing(js.Spherocylinders(alpha=4), n=24, seed=2, u0=1e-6, progress=False)
    found = js.minimise(start, strict=True, progress=False)
    assert found.results["n_negative"] == 0
    assert np.array_equal(found.box.matrix, start.box.matrix)
    assert found.u <= start.u * (1 + 1e-9)
    modes = found.modes()
    assert not (modes["sign"][modes.vibrational] < 0).any()


def test_too_few_evaluations_are_told():
    with pytest.warns(js.NotReachedWarning, match="it ended exhausted, with net forces up to"):
        found = js.minimise(pressed("rods"), evaluations=5, progress=False)
    assert not found.reached


def test_it_stops_and_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    start = pressed("rods")
    monkeypatch.setattr(stages, "EVALUATIONS", 20)
    whole = js.minimise(start, file=tmp_path / "whole.h5", progress=False)
    parts = tmp_path / "parts.h5"
    for _ in range(100):
        try:
            found = js.minimise(start, file=parts, seconds=0.0, progress=False)
        except TimeLimitError:
            continue
        break
    assert (found.position == whole.position).all()
    assert (found.orientation == whole.orientation).all()
    assert found.results["evaluations"] == whole.results["evaluations"]
    assert not list(tmp_path.glob("*.making.h5"))
    # What is done is loaded, and another state refused.
    assert (js.minimise(start, file=parts, progress=False).position == found.position).all()
    with pytest.raises(ValueError, match="holds a packing with start"):
        js.minimise(whole, file=parts, progress=False)


@pytest.mark.parametrize("suffix", ["h5", "data", "gsd"])
def test_the_command_takes_any_file(suffix, tmp_path, monkeypatch):
    if suffix == "gsd":
        pytest.importorskip("gsd")
    start = pressed("rods")
    js.save(tmp_path / f"state.{suffix}", start)
    monkeypatch.chdir(tmp_path)
    meaning = ("--shape", start.shape_style) if suffix == "data" else ()
    done = jamshape("minimise", f"state.{suffix}", *meaning, "--out", "minimum.h5")
    assert not done.code
    assert done.report["outcome"] == "converged"
    assert js.load(tmp_path / "minimum.h5").u == pytest.approx(js.minimise(start, progress=False).u)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"tolerance": 0.0}, "tolerance is 0"),
        ({"minimiser": "steepest"}, "minimiser is 'steepest', expected one of"),
        ({"evaluations": 0}, "evaluations is 0"),
    ],
)
def test_invalid_settings_are_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        js.minimise(pressed("discs"), **wrong)
