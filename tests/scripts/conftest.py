"""Fixtures for tests of scripts: scripts run in this process, which saves the time of starting them."""

import json
import runpy
import sys
from pathlib import Path

import pytest
from figures import ANALYSIS, NO_PACKINGS, PAPERS, require_told
from matplotlib.figure import Figure

DRAW = Figure.savefig


@pytest.fixture
def here(monkeypatch):
    """Run a script of analysis/; return how it ended."""

    def run_here(script, *arguments):
        path = ANALYSIS / script
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        monkeypatch.syspath_prepend(path.parent)
        try:
            runpy.run_path(str(path), run_name="__main__")
        except SystemExit as ended:
            return ended.code or 0
        return 0

    return run_here


@pytest.fixture
def undrawn(monkeypatch):
    """Leave out the drawing, which other tests look at."""
    monkeypatch.setattr(Figure, "savefig", lambda _, place, **__: Path(place).touch())


@pytest.fixture(scope="session")
def laid_out():
    """Scripts whose figures were laid out."""
    return set()


@pytest.fixture
def report(here, capsys, monkeypatch, laid_out):
    """Run a script that must succeed; return its last line, which is JSON without NaN.

    A figure of a paper, whichever test draws it, must tell what it is of and what its colours are. Only the first call
    of a script lays its figures out, which takes as long as to draw them.
    """
    figures, save, running = [], Figure.savefig, []

    def saved(figure, *arguments, **options):
        if laid_out.issuperset(running):
            figure.set_layout_engine("none")
        save(figure, *arguments, **options)
        figures.append(figure)

    monkeypatch.setattr(Figure, "savefig", saved)

    def reported(script, *arguments):
        figures.clear()
        running[:] = [script]
        assert here(script, *arguments) == 0
        if save is DRAW:
            laid_out.add(script)
        if Path(script).parent.name in PAPERS and Path(script).stem not in NO_PACKINGS:
            for figure in figures:
                require_told(script, figure)
        last = capsys.readouterr().out.splitlines()[-1]
        return json.loads(last, parse_constant=pytest.fail)

    return reported


@pytest.fixture
def problem(here):
    """Run a script that must end with one sentence after its name, and so with exit code 1."""

    def sentence(script, *arguments):
        said = here(script, *arguments)
        assert isinstance(said, str)
        assert "\n" not in said
        assert said.startswith(f"{Path(script).name}: ")
        return said

    return sentence


@pytest.fixture
def help_of(here, capsys):
    """Return what a script says to --help."""

    def text(script):
        assert here(script, "--help") == 0
        return capsys.readouterr().out

    return text
