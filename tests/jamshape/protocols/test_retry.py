"""The second attempt relaxes stalled packings until forces balance, the same after a kill."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from making import stages_of, write_every_mark
from mixtures import bidisperse

import jamshape as js
from jamshape.commands.contents import contents_of
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima import residual_of
from jamshape.minima.target import Target
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.make import make
from jamshape.protocols.retry import _PRICE, Retry, go_on


@cache
def seed():
    """Return that of 24 rods of alpha = 4 that end sliding, and are cured in steps: which it is depends on the last digits."""
    for k in (254, *range(1, 300)):
        with TemporaryDirectory() as folder:
            out = Path(folder) / "packing.h5"
            make(recipe_for(bidisperse(4.0), n=24, seed=k, u0=1e-12), out)
            found = read_attributes(out)
        is_cured = (found.get("retry_of"), found["outcome"]) == ("sliding", "converged")
        if is_cured and found["retry_steps"] > 1:
            return k
    raise AssertionError


def recipe(**more):
    return recipe_for(bidisperse(4.0), n=24, seed=seed(), u0=1e-12, **more)


def made(out, **how):
    make(recipe(), out, **how)
    return read_attributes(out)


@pytest.fixture(scope="module")
def cured(tmp_path_factory):
    out = tmp_path_factory.mktemp("cured") / "packing.h5"
    return out, made(out)


@pytest.fixture(scope="module")
def stalled(tmp_path_factory):
    out = tmp_path_factory.mktemp("stalled") / "packing.h5"
    return out, made(out, retry=False)


def test_a_second_try_balances_what_slides(cured, stalled):
    (out, now), (_, before) = cured, stalled
    assert (before["outcome"], now["outcome"], now["retry_of"]) == (
        "sliding",
        "converged",
        "sliding",
    )
    assert before["residual"] > now["tolerance"] >= now["residual"]
    assert now["retry_steps"] > 0
    packing = read_packing(out)
    landscape, state = Landscape(packing), State.of(packing)
    evaluation = landscape.evaluate(state)
    assert residual_of(landscape, evaluation).largest <= now["tolerance"]
    assert evaluation.energy / state.volume == pytest.approx(1e-12, rel=1e-7, abs=0)
    assert now["evaluations"] == before["evaluations"] + now["retry_evaluations"]


def test_after_a_kill_it_ends_in_the_same_packing(cured, tmp_path, monkeypatch):
    write_every_mark(monkeypatch)
    out = tmp_path / "packing.h5"
    first = stages_of(recipe(), tmp_path / "whole.h5").index("retry")
    (tmp_path / "whole.h5").unlink()
    assert stages_of(recipe(), out, first + 2)[first:] == ["retry"] * 2
    file = tmp_path / "packing.h5.making.h5"
    assert read_attributes(file)["stage"] == "retrying"
    told = contents_of(file)
    assert (told["kind"], told["finished"]) == ("packing in the making", False)
    assert told["go_on"].startswith(f"repeat the command for {out}, which")
    again = made(out)
    assert [path.name for path in tmp_path.iterdir()] == ["packing.h5"]
    whole, known = cured
    for one, other in zip(read_packing(out).poses(), read_packing(whole).poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    for name in ("u", "residual", "outcome", "evaluations", "retry_steps", "retry_evaluations"):
        assert again[name] == known[name], name


def test_what_it_does_not_cure_stays_as_it_was_and_is_said(stalled, tmp_path, monkeypatch):
    """The same happens when its work is used up."""
    monkeypatch.setattr("jamshape.protocols.retry._EVALUATIONS", 1)
    monkeypatch.setattr("jamshape.protocols.retry._PRICE", 10**6)
    out = tmp_path / "packing.h5"
    with pytest.warns(
        js.NotReachedWarning, match="ended sliding after a second attempt, with net forces up to"
    ):
        packing = js.make_packing(
            bidisperse(4.0), n=24, seed=seed(), u0=1e-12, file=out, progress=False
        )
    assert not packing.reached
    before, _ = stalled
    for one, other in zip(packing.poses(), read_packing(before).poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    with pytest.warns(js.NotReachedWarning):  # also where it is only read again
        js.make_packing(bidisperse(4.0), n=24, seed=seed(), u0=1e-12, file=out, progress=False)
    with pytest.warns(js.NotReachedWarning, match="ended sliding"):
        modes = js.modes(packing, lowest=4)
    assert len(js.modes(packing, lowest=4, force=True)) == len(modes)


def test_its_work_is_bounded(stalled):
    packing = read_packing(stalled[0])
    landscape, target = Landscape(packing), Target(1e-12)
    assert [*go_on(landscape, Retry(State.of(packing), 0), target)] == []
    retry = Retry(State.of(packing), _PRICE)
    for _ in go_on(landscape, retry, target):
        pass
    assert retry.n_steps <= 1


def test_strict_packings_and_searches_as_published_have_none():
    assert recipe().is_searched
    published = recipe_for(bidisperse(4.0), n=16, protocol="marschall-2018", search="bisection")
    assert not published.is_searched
    assert not recipe_for(bidisperse(4.0), n=16, protocol="steps").is_searched
