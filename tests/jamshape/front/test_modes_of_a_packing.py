"""Results of `js.modes`: translations, bands, moduli."""

import json
import math

import numpy as np
import pytest

import jamshape as js
from common.mode_tables import Wanted, pick_modes
from jamshape.command import plain
from jamshape.commands.modes import summary_of
from jamshape.drawing.modes import mode_figure
from jamshape.vibration.ensembles import TOLD
from jamshape.vibration.statistics import density_of_states


@pytest.fixture(scope="module")
def packing():
    return js.make_packing(js.Spherocylinders(alpha=2), n=16, seed=1, u0=1e-8, progress=False)


@pytest.fixture(scope="module")
def whole(packing):
    return js.modes(packing)


@pytest.fixture(scope="module")
def far():
    """Rods far above jamming."""
    return js.modes(
        js.make_packing(js.Spherocylinders(alpha=4), n=16, seed=1, u0=1e-3, progress=False)
    )


def test_translations_are_in_no_statistic(whole):
    assert whole.in_band("translation").tolist() == np.flatnonzero(whole["is_translation"]).tolist()
    assert (whole.omega[whole["is_translation"]] == 0).all()
    found = density_of_states(whole.omega)
    assert found.n_modes.sum() == len(whole) - 2 == len(whole.vibrational)
    assert found.edges[0] <= whole.omega[whole.vibrational][0] < found.edges[1]
    parts = summary_of(whole.table)
    assert sum(part["fraction"] for part in parts.values()) == pytest.approx(1, rel=1e-15)


def test_an_unknown_column_lists_the_known_ones(whole):
    with pytest.raises(KeyError, match=r"bandd is not a column of modes, expected one of .*band, "):
        whole["bandd"]


@pytest.mark.parametrize("k", [4, 45, 46])
def test_few_modes_are_told_like_all(packing, whole, k):
    few = js.modes(packing, lowest=k)
    assert len(few.vibrational) == k
    assert few["is_translation"].sum() == 2
    softest = np.sort(np.abs(whole.eigenvalues[whole.vibrational]))[:k]
    np.testing.assert_allclose(np.abs(few.eigenvalues[few.vibrational]), softest, rtol=1e-9)
    assert (few.omega[few["is_translation"]] == 0).all()
    for name in ("bulk", "pure_shear", "simple_shear"):
        own, other = getattr(few.moduli, name), getattr(whole.moduli, name)
        assert abs(own.relaxed - other.relaxed) <= own.bound + other.bound


@pytest.mark.parametrize("n", [1, 2])
def test_one_or_two_discs(n):
    discs = js.make_packing(js.Spherocylinders(alpha=0), n=n, seed=1, u0=1e-8, progress=False)
    found = js.modes(discs)
    assert len(found) == 2 * n
    assert len(found.vibrational) == density_of_states(found.omega).n_modes.sum() == 2 * n - 2
    bulk = found.moduli.bulk
    assert 0 < bulk.bound < 1e-9 * bulk.relaxed
    said = "has no vibrational modes: all its 2 modes are translations"
    with pytest.raises(ValueError, match=said if n == 1 else "expected from 1 to 2"):
        js.modes(discs, lowest=2 * n - 1)


def test_far_above_jamming_there_are_no_bands_and_it_says_why(far):
    assert all(len(far.in_band(name)) == 0 for name in TOLD)
    assert len(far.in_band("translation")) == 2
    assert "(no bands)" in repr(far)
    assert far.table.attributes["why_no_bands"] in repr(far)
    assert "constrain all of the 46 vibrational modes" in repr(far)
    found = json.loads(json.dumps(plain(summary_of(far.table)), allow_nan=False))
    assert found == {"low": None, "middle": None, "high": None}
    assert len(pick_modes(far.table, Wanted(per_band={"low": 1, "high": 2}))) == 3
    mode_figure(far.told, "far above jamming")


def test_modes_of_a_file_have_the_same_moduli(whole, far, tmp_path):
    for modes in (whole, far):
        modes.save(tmp_path / "modes.h5")
        found = js.load(tmp_path / "modes.h5")
        assert found.moduli == modes.moduli
        assert repr(found) == repr(modes)
    shear = whole.moduli.simple_shear
    assert shear.bound == shear.rounding + shear.of_state < 1e-6 * abs(shear.relaxed)
    assert whole.table.attributes["simple_shear_modulus_bound"] == shear.bound


def test_a_state_that_is_no_minimum_has_modes_but_no_moduli(packing):
    moved = packing.with_(position=packing.position + 1e-6 * np.sin(np.arange(32).reshape(16, 2)))
    found = js.modes(moved, force=True)
    assert math.isnan(found.moduli.bulk.relaxed)
    assert "the state is not at a minimum" in found.moduli.bulk.reason
