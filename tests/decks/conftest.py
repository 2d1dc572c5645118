"""Scripts of pyscripts/ that refuse, run in this process, which saves the time of starting them."""

import runpy
import sys
from subprocess import CompletedProcess

import pytest


@pytest.fixture
def run_here(monkeypatch, capfd):
    """Run a script; return how it ended, as `subprocess.run` does."""

    def run(driver, *options):
        arguments = [str(driver), *map(str, options)]
        monkeypatch.setattr(sys, "argv", arguments)
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            runpy.run_path(arguments[0], run_name="__main__")
        said, code = capfd.readouterr(), end.value.code
        if isinstance(code, str):
            return CompletedProcess(arguments, 1, said.out, f"{said.err}{code}\n")
        return CompletedProcess(arguments, code or 0, said.out, said.err)

    return run
