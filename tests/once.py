"""What takes long and is the same for many tests, made once for all processes of pytest."""

from __future__ import annotations

import fcntl
import os
import shutil
from pathlib import Path


def made_once(tmp_path_factory, name, make):
    """Return a folder of this name, which the first process that asks fills by `make(folder)`; others wait."""
    shared = tmp_path_factory.getbasetemp()
    at = (shared.parent if "PYTEST_XDIST_WORKER" in os.environ else shared) / name
    with Path(f"{at}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not at.exists():
            # Renamed when it is whole; what a process that failed has left is no use.
            new = Path(f"{at}.new")
            shutil.rmtree(new, ignore_errors=True)
            new.mkdir()
            make(new)
            new.rename(at)
    return at
