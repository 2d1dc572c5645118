"""The solution of contacts of superellipsoids in 33 digits, compiled once."""

import fcntl
import os
import shutil
from pathlib import Path

import pytest

ERRORS = Path(__file__).parents[2] / "analysis" / "errors"


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    """The script that compares with 33 digits, and its reference, which processes of one run of the tests share."""
    if shutil.which("g++") is None:
        pytest.skip("no g++")
    folder = tmp_path_factory.getbasetemp()
    folder = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "reference"
    folder.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ERRORS))
        script = __import__("superellipsoid_error")
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            made = folder / "made"
            if not made.exists():
                made.write_text(str(script.compiled(folder)))
        yield script, Path(made.read_text())
