"""Runs that do not reach their goals, or whose frames tell nothing, say so."""

import warnings

import numpy as np
import pytest

import jamshape as js
from jamshape.measures.jamming import Jamming, Tried
from jamshape.protocols.random_start import random_packing

DISCS = js.Spherocylinders(alpha=0)


@pytest.fixture(scope="module")
def start():
    return random_packing(8, 0.5, 1, DISCS)


@pytest.mark.lammps
def test_a_compression_in_lammps_ends_at_a_pressure_or_says_that_it_did_not(tmp_path):
    how = {"n": 16, "phi": (0.5, 1.0), "kappa": 1e-3, "rows": 100, "progress": False}
    rods = js.Spherocylinders(alpha=1)
    whole = js.compress(rods, file=tmp_path / "whole.h5", **how)
    run = js.compress(rods, p_end=1e-2, file=tmp_path / "run.h5", **how)
    end = int(np.argmax(whole.pressure >= 1e-2))
    assert 0 < end < 100
    np.testing.assert_array_equal(run.pressure, whole.pressure[: end + 1])
    assert run.packing().phi == pytest.approx(run.phi[-1], rel=1e-12)
    assert js.resume(run.file, progress=False).about["finished"]
    assert "p_end" not in whole.about
    with pytest.raises(ValueError, match=r"a compression with p_end=0\.01, expected"):
        js.compress(rods, file=run.file, **how)
    with pytest.warns(js.NotReachedWarning, match=r"expected p_end=0.5; take a larger phi_end"):
        js.compress(rods, p_end=0.5, file=tmp_path / "not.h5", **how)


def test_a_pressure_that_is_not_reached_is_said(start, tmp_path):
    how = {"phi": (None, 0.52), "kappa": 1e-3, "file": tmp_path / "slow.h5", "progress": False}
    with pytest.warns(js.NotReachedWarning, match=r"expected p_end=0.5; take a larger phi_end"):
        js.slow_compress(start=start, p_end=0.5, **how)
    with pytest.warns(js.NotReachedWarning, match=r"at the end, phi = 0.52, expected p_end=0.5"):
        js.resume(tmp_path / "slow.h5", progress=False)
    with pytest.raises(ValueError, match=r"a compression with p_end=0\.5, expected inf"):
        js.slow_compress(start=start, **how)


IGNORED = "1 of 3 minimised frames ended neither at rest nor without energy and is ignored"


@pytest.fixture
def with_frames(start, tmp_path, monkeypatch):
    """Make a run whose minimised frames stay jammed or not as told, the densest first."""
    how = {"phi": (None, 0.52), "kappa": 1e-3, "file": tmp_path / "slow.h5", "progress": False}
    run = js.slow_compress(start=start, **how)

    def make(*stays):
        tried = [Tried(2 - k, 0.52 - 0.01 * k, one) for k, one in enumerate(stays)]
        monkeypatch.setattr("jamshape.front.run.minimised_frames", lambda *_: iter(tried))
        return run

    return make


def test_frames_that_come_to_no_end_are_said_where_jamming_is_found(with_frames):
    run = with_frames(True, None, False)
    for again in (run, js.load(run.file)):
        found = again.jamming(progress=False)
        assert found == Jamming(0.5, 0.52, 3, 1)
        assert found.verdict(None, 1e-3).endswith(f"at phi = 0.52000 stays jammed; {IGNORED}.")
    assert Jamming.stored(found.attributes()) == found


@pytest.mark.parametrize("stays", [(None, False, False), (True, True, None)])
def test_frames_that_come_to_no_end_warn_where_it_is_not_found(with_frames, stays):
    run = with_frames(*stays)
    for again in (run, js.load(run.file)):
        with pytest.warns(js.NotReachedWarning, match=f"{IGNORED}: .*; record more frames"):
            again.jamming(progress=False)


def test_rows_of_a_quasistatic_shear_whose_forces_do_not_balance_are_said(tmp_path):
    packing = js.make_packing(DISCS, n=8, u0=1e-14, phi_start=0.5, progress=False)
    how = {"start": packing, "step": 1e-9, "strain": 2e-9, "progress": False}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert js.quasistatic_shear(**how).at_rest.all()
    # Forces cannot balance better than rounding lets them.
    with pytest.warns(js.NotReachedWarning, match="forces do not balance in 3 of 3 rows"):
        run = js.quasistatic_shear(**how, tolerance=1e-14, file=tmp_path / "aqs.h5")
    np.testing.assert_array_equal(run.at_rest, False)
