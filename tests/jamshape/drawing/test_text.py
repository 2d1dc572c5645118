import pytest

from common.text import (
    ensemble_labels,
    ensembles_title,
    range_text,
    samples_text,
    short,
    system_labels,
)
from jamshape.drawing.text import attributes_text, scientific, system_text, systems_text, unit_text
from jamshape.files.sets import System
from jamshape.measures.runs import Ensemble
from jamshape.shapes.particles import Kind, Particles

ROD = "spherocylinder"
RODS = System(ROD, 2, (("alpha", 4.0),))
BALLS = System(
    "superellipsoid", 3, (("exponent", 1.5), ("w1", 1.0), ("w2", 1.0)), protocol="yuan-2019-1"
)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0, "0"), (1e-15, "10^{-15}"), (4e-6, r"4\times 10^{-6}"), (1.0, "10^{0}")],
)
def test_powers_of_ten(value, text):
    assert scientific(value) == text


def test_small_numbers_are_powers_of_ten():
    assert (short(0.25), short(2.5e-3)) == ("0.25", r"2.5\times 10^{-3}")


def test_counts():
    assert range_text([1, 1], "sample") == "1 sample"
    assert range_text([2, 1], "sample") == "1 to 2 samples"
    assert samples_text(32, {0: "a", 1: "ab"}) == "$N=32$, 1 to 2 samples each"
    assert samples_text(32, {0: "abc"}) == "$N=32$, 3 samples"


def test_labels_tell_what_differs():
    others = [RODS, RODS._replace(parameters=(("alpha", 0.0),))]
    assert [*system_labels(others).values()] == [r"$\alpha=4$", r"$\alpha=0$"]
    both = system_labels([RODS, BALLS])
    assert both[RODS] == r"spherocylinders, 2D, $\alpha=4$, dynamics"
    assert both[BALLS] == r"superellipsoids, 3D, $p=1.5, w_1=1, w_2=1$, yuan-2019-1"
    assert system_labels([RODS.without("alpha")]) == {RODS.without("alpha"): ""}
    assert unit_text([RODS]) == "(2R)"
    assert unit_text([RODS, BALLS]) == r"(\mathrm{length})"


def test_titles_tell_all_that_systems_are_of():
    assert systems_text([RODS]) == r"spherocylinders in 2D, $\alpha=4$"
    several = [RODS, RODS._replace(parameters=(("alpha", 0.01),), dimension=3)]
    assert systems_text(several) == r"spherocylinders in 2D and 3D, $\alpha=0.01$ to $4$"
    assert systems_text([BALLS]) == "superellipsoids in 3D, $p=1.5, w_1=1, w_2=1$, yuan-2019-1"
    assert systems_text([RODS, BALLS]) == "spherocylinders and superellipsoids in 2D and 3D"


def test_energy_and_rate_are_told_as_far_as_they_are_known():
    assert attributes_text({"n": 3}) == []
    assert attributes_text({"u0": 0.0, "kappa": [[0.8, 1e-6], [0.9, 1e-8]]}) == [
        "first jammed",
        r"$\kappa=10^{-8}$",
    ]


def test_what_is_unusual_is_named():
    dimer = System("dimer", 2, (("alpha", 1.0),))
    assert system_labels([dimer]) == {dimer: r"dimers, $\alpha=1$"}
    assert system_labels([dimer.without("alpha")]) == {dimer.without("alpha"): "dimers"}
    space = RODS._replace(dimension=3)
    assert system_labels([space]) == {space: r"3D, $\alpha=4$"}
    assert system_labels([BALLS]) == {BALLS: "$p=1.5, w_1=1, w_2=1$"}


def test_mixtures_are_named_by_their_kinds():
    kinds = [Kind({"alpha": 4.0}), Kind({"alpha": 0.0}, 1.4, 3.0)]
    told = Particles.mixture(ROD, kinds).told["kinds"]
    text = system_text(System(ROD, 2, (), told))
    assert text == r"$\alpha=4$, $2R=1$, 25 %; $\alpha=0$, $2R=1.4$, 75 %"
    given = System(ROD, 2, (), "given one by one")
    assert system_text(given) == "spherocylinders given one by one"


def test_ensembles_of_compressions():
    slow, fast = (Ensemble(RODS, 64, 1.4, kappa) for kappa in (1e-8, 1e-6))
    assert ensemble_labels([slow, fast])[slow] == r"$N=64$, $\kappa=10^{-8}$"
    assert ensembles_title([slow, fast]) == r"spherocylinders in 2D, $\alpha=4$, $R_b/R_s=1.4$"
