"""The solution of contacts of superellipsoids in 33 digits, compiled once."""

import shutil
from pathlib import Path

import pytest
from once import made_once

ERRORS = Path(__file__).parents[2] / "analysis" / "errors"


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """The script that compares with 33 digits, and its reference, which processes of one run of the tests share."""
    if shutil.which("g++") is None:
        pytest.skip("no g++")
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ERRORS))
        script = __import__("superellipsoid_error")
        folder = made_once(tmp_path_factory, "reference", script.compiled)
        (program,) = folder.iterdir()
        yield script, program
