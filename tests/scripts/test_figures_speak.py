"""Figures tell what they are of: `report` of conftest.py looks at every one; here are all named, and that it sees."""

import re

import pytest
from figures import ANALYSIS, PAPERS, require_told, unnamed, words
from matplotlib.figure import Figure

TOLD = "spherocylinders in 2D, $\\alpha=4$\n$N=64$, $\\kappa=10^{-6}$"


def figure_with(title, label):
    figure = Figure()
    axes = figure.subplots()
    axes.plot([0, 1], [0, 1], "C1", label=label)
    axes.axvline(0.5, color="0.5")
    axes.set_title(title)
    if label:
        axes.legend()
    return figure


def test_what_is_told_is_seen():
    figure = figure_with(TOLD, "p")
    require_told("a script", figure)
    assert "N=64" in words(figure)
    assert not unnamed(figure)


@pytest.mark.parametrize("left_out", ["N=64", r"\kappa", "in 2D", r"\alpha=4"])
def test_what_is_left_out_is_missed(left_out):
    with pytest.raises(AssertionError, match="a script"):
        require_told("a script", figure_with(TOLD.replace(left_out, ""), "p"))


def test_colours_without_a_name_are_missed():
    with pytest.raises(AssertionError, match="has colours without a name"):
        require_told("a script", figure_with(TOLD, ""))


@pytest.mark.parametrize("folder", PAPERS)
def test_every_figure_is_drawn_by_some_test(folder):
    tests = "\n".join(path.read_text() for path in (ANALYSIS.parent / "tests/scripts").glob("*.py"))
    scripts = [path.stem for path in (ANALYSIS / folder).glob("*.py")]
    assert scripts
    assert not [name for name in scripts if not re.search(rf"\b{name}\b", tests)]
