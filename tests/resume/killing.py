"""Runs that are killed at moments that nobody chose, and what is left of them.

Commands and drivers run in processes forked from one that has imported everything, so that hundreds of kills take
minutes and nearly all of them fall into the work itself.
"""

from __future__ import annotations

import importlib
import multiprocessing
import os
import random
import signal
import sys
import time
import warnings

import h5py
import numpy as np
from matplotlib.image import imread

from jamshape.exchange.gsd import read_gsd
from jamshape.files.lammps_text import read_data

# The folder, in that of a run, of what the run reads.
GIVEN = "given"

# The time that something took, which differs from run to run, and the history of a search, which is that
# of the process that ended it.
CLOCKS = {"wall_seconds", "flow_wall_seconds", "shear_wall_seconds"}
OF_THE_PROCESS = ("report/",)

_SECONDS = 120
_COMMANDS = (
    "compress",
    "pack",
    "minimise",
    "slow",
    "shear",
    "cycle",
    "aqs",
    "sweep",
    "modes",
    "draw",
    "export",
    "initial",
)
_PRELOADED = [
    "jamshape",
    *(f"jamshape.commands.{name}" for name in _COMMANDS),
    "matplotlib.figure",
    "matplotlib.backends.backend_agg",
]


def forked(target, args, log, patches=(), fuse=0):
    """Call a function in a process of its own, with other values of some constants.

    Parameters
    ----------
    target, args
        Function of a module, and its arguments.
    log
        File that receives what it says.
    patches
        Names of constants with other values.
    fuse
        Number of the call that changes files at which the process is killed; 0 for none.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(_PRELOADED)
    process = context.Process(target=_called, args=(target, args, str(log), tuple(patches), fuse))
    process.start()
    return process


def _called(target, args, log, patches, fuse):
    file = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
    os.dup2(file, 1)
    os.dup2(file, 2)
    sys.stdout, sys.stderr = (os.fdopen(k, "w", buffering=1, closefd=False) for k in (1, 2))
    for name, value in patches:
        module, constant = name.rsplit(".", 1)
        setattr(importlib.import_module(module), constant, value)
    if fuse:
        light(fuse, lambda: os.kill(os.getpid(), signal.SIGKILL))
    target(*args)


def command(words):
    """Run the command jamshape."""
    from jamshape.commands import main  # noqa: PLC0415 - in the process that is to be killed

    main([str(word) for word in words])


CALLS = ("open", "fsync", "replace", "rename", "link", "unlink")
"""Calls of the system between which files change."""


def light(at, end=None):
    """Count calls that change files, and call `end` before one of them; return the list whose length is the count."""
    calls = []

    def around(name, call):
        def counted(*args, **options):
            calls.append(name)
            if len(calls) == at:
                end()
            return call(*args, **options)

        return counted

    for name in CALLS:
        setattr(os, name, around(name, getattr(os, name)))
    return calls


def ended(process, after=_SECONDS):
    """Wait until a process has ended and return its exit code, or kill it after some seconds."""
    process.join(after)
    if process.exitcode is None:
        process.kill()  # also of one that has just ended
        process.join(_SECONDS)
    return process.exitcode


def uninterrupted(case, folder):
    """Run a case to its end; return how long that took."""
    prepare(case, folder)
    ended(
        forked(command, (["--version"],), folder / "said.log")
    )  # the process to fork from imports all that there is
    began = time.monotonic()
    code = ended(case.start(folder))
    assert code == 0, said(folder)
    return time.monotonic() - began


def killed(case, folder, seconds, kills, seed):
    """Run a case, which takes so many seconds, kill it several times on the way, and let it end; count kills.

    After each kill all files are looked at.
    """
    given = prepare(case, folder)
    rng, count = random.Random(seed), 0
    for _ in range(kills):
        code = ended(case.start(folder), rng.uniform(0, seconds))
        if code != -signal.SIGKILL:
            assert code == 0, said(folder)
            break
        count += 1
        require_whole(folder)
        require_as_they_were(given, "was given and was changed")
    else:
        finished = finished_files(folder)
        assert ended(case.start(folder)) == 0, said(folder)
        require_as_they_were(finished, "was finished and was made again")
    require_as_they_were(given, "was given and was changed")
    return count


def prepare(case, folder):
    """Make the folder of a run, with what the run is given to read; return these files as they are."""
    (folder / GIVEN).mkdir(parents=True)
    for name, write in case.given.items():
        write(folder / GIVEN / name)
    return {path: stamp(path) for path in (folder / GIVEN).iterdir()}


def require_as_they_were(files, complaint):
    for path, before in files.items():
        assert stamp(path) == before, f"{path.name} {complaint}"


def require_whole(folder):
    """Every file that is there under its name can be read to its end."""
    for pattern, read in READERS.items():
        for path in folder.rglob(pattern):
            read(path)


def _read_hdf5(path):
    with h5py.File(path) as file:
        file.visititems(lambda _, part: part[()] if isinstance(part, h5py.Dataset) else None)


def _read_data(path):
    with warnings.catch_warnings(action="ignore"):  # of what LAMMPS does not write
        read_data(path)


READERS = {
    "*.h5": _read_hdf5,
    "*.h5md": _read_hdf5,
    "*.png": imread,
    "*.data": _read_data,
    "*.gsd": read_gsd,
}


def finished_files(folder):
    """Find packings that are finished, with when they were written."""
    found = {}
    for path in folder.glob("*.h5"):
        with h5py.File(path) as file:
            if "outcome" in file["parameters"].attrs:
                found[path] = stamp(path)
    return found


def stamp(path):
    return path.stat().st_mtime_ns, path.read_bytes()


def said(folder):
    return (folder / "said.log").read_text()[-2000:]


def contents(path, without=()):
    """All numbers of an HDF5 file by name, but for those of clocks and of some groups."""
    found = {}

    def take(name, part):
        if name.split("/")[-1] in CLOCKS or name.startswith(without):
            return
        for key, value in part.attrs.items():
            if key not in CLOCKS:
                found[f"{name}@{key}"] = np.asarray(value)
        if isinstance(part, h5py.Dataset):
            found[name] = part[()]

    with h5py.File(path) as file:
        file.visititems(take)
    return found


def differences(one, other, without=OF_THE_PROCESS):
    """Names of what differs by a bit, or by its type, between two files."""
    if one.suffix not in {".h5", ".h5md"}:
        return [] if one.read_bytes() == other.read_bytes() else [one.name]
    a, b = contents(one, without), contents(other, without)
    return sorted(a.keys() ^ b.keys()) + [k for k in a.keys() & b.keys() if not _same(a[k], b[k])]


def _same(a, b):
    a, b = np.asarray(a), np.asarray(b)
    return a.dtype == b.dtype and np.array_equal(a, b, equal_nan=a.dtype.kind == "f")
