"""What tests of scripts share."""

import runpy
import sys
from pathlib import Path

import pytest

ANALYSIS = Path(__file__).parents[2] / "analysis"


@pytest.fixture
def here(monkeypatch):
    """Run a script in this process, which saves the time of starting it; return how it ended."""

    def run_here(script, *arguments):
        path = ANALYSIS / script
        monkeypatch.setattr(sys, "argv", [str(path), *map(str, arguments)])
        monkeypatch.syspath_prepend(str(path.parent))
        try:
            runpy.run_path(str(path), run_name="__main__")
        except SystemExit as ended:
            return ended.code
        return 0

    return run_here
