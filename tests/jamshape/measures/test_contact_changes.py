"""Contacts that open and close along ladders and quasistatic shear: what is listed, where, and whether it returns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from in_process import jamshape
from small_packings import jammed

import jamshape as js
from jamshape.checks import NotReachedWarning
from jamshape.landscape import State
from jamshape.measures.contact_changes import At, Search, contact_changes

VALUES = (1e-5, 1e-6, 1e-7, 1e-4)


@pytest.fixture(scope="module")
def start():
    landscape, found = jammed("rods of alpha 1", 1e-4)
    return found.state.packing(landscape.particles)


@pytest.fixture(scope="module")
def run(start, tmp_path_factory):
    file = tmp_path_factory.mktemp("ladder") / "ladder.h5"
    return js.ladder(start, u0=VALUES, file=file, progress=False)


def pair(gap, image=0):
    """Two discs at a distance in a large box, the second one as seen in another image."""
    discs = js.Spherocylinders(alpha=0)
    from jamshape.protocols.random_start import random_packing  # noqa: PLC0415

    packing = random_packing(2, 0.05, 1, discs)
    place = np.zeros((2, 2))
    place[1, 0] = packing.diameters[:, 0].mean() * (1 + gap) + image * packing.box.edges[0]
    return packing.with_(position=place, image=np.zeros_like(packing.image))


def test_a_contact_is_found_where_it_opens():
    """Of two discs that are moved apart, at the gap 0, whatever their images; it returns."""

    def bring(_, value):
        return pair(value, image=1)

    states = [At(-0.011, pair(-0.011)), At(0.03, pair(0.03))]
    (wide,) = contact_changes(states, Search(bring))
    assert wide == (-0.011, 0.03, (1, 2), 1, "opened", None)
    (close,) = contact_changes(states, Search(bring, within=1e-9, step_back=True))
    assert close.before < 0 <= close.after
    assert close.after - close.before <= 1e-9 * 0.03
    assert close.returns
    (back,) = contact_changes(states[::-1], Search(bring, within=1e-9))
    assert back.change == "closed"
    assert back.after < 0 <= back.before


def test_a_packing_that_does_not_return_is_told(start):
    moved = State.of(start)
    shift = np.zeros_like(moved.position)
    shift[0, 0] = 0.3 * start.inner_radius.min()
    other = replace(moved, position=moved.position + shift).packing(start)
    changes = contact_changes(
        [At(1.0, start), At(2.0, other)], Search(lambda *_: other, step_back=True)
    )
    assert changes
    assert not any(change.returns for change in changes)


def test_each_state_is_kept_with_its_numbers(run, start):
    assert run.values[1:].tolist() == list(VALUES)
    np.testing.assert_allclose(run["u"], [run.values[0], *VALUES], rtol=1e-6)
    assert run.reached.all()
    assert run.at_rest.all()
    for k, packing in enumerate(run):
        assert packing.u == pytest.approx(run.values[k], rel=1e-6)
        assert packing.z == pytest.approx(run["z"][k], rel=1e-12)
    np.testing.assert_array_equal(run.packing(0).position, start.position)
    assert isinstance(js.load(run.file), js.LadderFile)
    assert js.resume(run.file, progress=False).about["finished"]


def test_changes_between_states_add_up_to_the_difference(run):
    changes = run.contact_changes()
    signs = {"opened": -1, "closed": 1}
    bonds = [int(packing.contacts().network.n_bonds.sum()) for packing in run]
    assert sum(signs[one.change] for one in changes) == bonds[-1] - bonds[0]
    assert run.opened.sum() == sum(one.change == "opened" for one in changes) > 0
    assert run.closed.sum() == len(changes) - run.opened.sum() > 0
    np.testing.assert_array_equal(np.cumsum(run.closed - run.opened), np.array(bonds) - bonds[0])


def test_changes_are_enclosed_as_closely_as_requested(run):
    wide, close = run.contact_changes(), run.contact_changes(within=1e-4, step_back=True)
    assert len(close) >= len(wide)
    for one in close:
        low, high = sorted((one.before, one.after))
        assert 0 < high / low - 1 <= 1e-4
        assert one.returns is not None
    opened = [one.before for one in close if one.before > one.after]
    assert opened == sorted(opened, reverse=True)
    values = list(zip(run.values, run.values[1:], strict=False))
    assert all((one.before, one.after) in values for one in wide)


def test_changes_of_a_quasistatic_shear_have_its_strain(start, tmp_path):
    file = tmp_path / "aqs.h5"
    run = js.quasistatic_shear(start=start, step=1e-2, strain=0.05, file=file, progress=False)
    changes = run.contact_changes()
    assert len(run) == 7
    assert changes
    for one in changes:
        assert one.after - one.before == pytest.approx(1e-2, rel=1e-9)
    for one in run.contact_changes(within=1e-3):
        assert 0 < one.after - one.before <= 1e-3 * 0.05
    bonds = [int(run.packing(k).contacts().network.n_bonds.sum()) for k in (1, -1)]
    assert sum(1 if one.change == "closed" else -1 for one in changes) == bonds[1] - bonds[0]


def test_values_that_are_not_reached_are_told_and_passed(start, monkeypatch, tmp_path):
    from jamshape.minima.target import TargetError  # noqa: PLC0415
    from jamshape.protocols import ladder  # noqa: PLC0415

    bring = ladder.bring

    def fails_once(landscape, state, goal):
        if goal.u0 == 1e-6:
            msg = "no minimum"
            raise TargetError(msg)
        return bring(landscape, state, goal)

    monkeypatch.setattr(ladder, "bring", fails_once)
    with pytest.warns(
        NotReachedWarning, match="at 1e-06 no minimum with balanced forces was found"
    ):
        run = js.ladder(start, u0=(1e-5, 1e-6, 1e-7), file=tmp_path / "l.h5", progress=False)
    assert run.reached.tolist() == [True, True, False, True]
    assert run["u"][2] == run["u"][1]
    assert (run.opened[2], run.closed[2]) == (0, 0)


def test_wrong_values_are_refused(run, start):
    for values, words in (
        ([], "u0 has no values"),
        ([0.0], "u0 is 0.0"),
        ([1e-6] * 7001, "u0 has 7001 values, expected at most 7000"),
        ([1e-6, -1.0], "u0 is -1.0"),
        ([1e-6, 1e-2], "u0 is 0.01, whose overlaps"),
    ):
        with pytest.raises(ValueError, match=words):
            js.ladder(start, u0=values, progress=False)
    with pytest.raises(ValueError, match=r"within is 0\.0, expected a relative distance"):
        run.contact_changes(within=0.0)
    with pytest.raises(ValueError, match="expected"):
        js.ladder(start, u0=[1e-6], file=run.file, progress=False)


def test_the_command_reports_changes_and_draws(run, tmp_path, monkeypatch):
    run.packing(0).save(tmp_path / "packing.h5")
    monkeypatch.chdir(tmp_path)
    words = "packing.h5 --u0 1e-5 1e-6 --out l.h5 --plot l.png --within 1e-2 --step-back"
    done = jamshape("ladder", *words.split())
    assert not done.code
    found = done.report
    assert [state["u0"] for state in found["states"]][1:] == [1e-5, 1e-6]
    assert found["opened"] == sum(state["opened"] for state in found["states"])
    assert len(found["changes"]) >= found["opened"] + found["closed"] > 0
    assert found["irreversible"] >= 0
    assert (tmp_path / "l.png").stat().st_size > 1000
    axes = run.plot()
    assert {line.get_label() for line in axes.figure.axes[1].lines} == {"opened", "closed"}
