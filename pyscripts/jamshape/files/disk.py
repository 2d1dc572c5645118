"""Files that are replaced as a whole: what stood there before stands until the new one is safe on the disk.

A file is written under a temporary name in the same folder, ``.NAME.HOST.PID.tmp``, and takes its place by a
rename. A process that is killed leaves its temporary file behind; the next one that writes the same file
removes it.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PathLike = str | os.PathLike[str]

# What a disk or a folder may have against being written to.
_REFUSALS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO}

_END = ".tmp"

# Ends of names that say what a file is, and not HDF5.
_OTHERS = {".data", ".gsd", ".dump", ".png", ".pdf", ".csv", ".json", ".txt"}


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Return a temporary path in the folder of `path`, which takes its place if the body succeeds.

    If the body raises, the temporary file is removed and what stood at `path` still stands. Where `path`
    is a link, what it leads to is replaced.

    Raises
    ------
    OSError
        One sentence, if the disk is full, or the folder is not there or not to be written to.
    """
    place = real(path)
    remove_leftovers(place)
    temporary = place.with_name(f"{_prefix(place)}{os.getpid()}{_END}")
    with refusals(path, temporary):
        try:
            yield temporary
            temporary.replace(place)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


def store(path: PathLike, data: bytes | memoryview, *, wait: bool = True) -> None:
    """Write a whole file, on the disk before it takes its place; errors as `replacing`.

    What is of use for a short time only need not wait for the disk, and survives kills just as well.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(data)
        file.flush()
        if wait:
            os.fsync(file.fileno())


@contextmanager
def refusals(path: PathLike, temporary: Path) -> Iterator[None]:
    """Say in one sentence that a disk or a folder refuses to take a file."""
    try:
        yield
    except OSError as error:
        if error.errno not in _REFUSALS and error.filename != str(temporary):
            raise
        msg = (
            f"{path}: cannot be written ({error.strerror}), expected a folder with room that may be"
            " written to; make room or choose another, what was there before is as it was"
        )
        refusal = OSError(msg)
        refusal.errno = error.errno  # for those who ask; the sentence is all that is printed
        raise refusal from error


def settled(path: PathLike | None) -> Path | None:
    """Make a path absolute, so that it leads to the same file wherever the process goes."""
    return None if path is None else Path(path).absolute()


def named(path: Path) -> str:
    """Name a file as one would type it here: from the working folder on, if it lies in it.

    Examples
    --------
    >>> named(Path.cwd() / "run.h5")
    'run.h5'
    """
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def require_hdf5_name(path: Path) -> None:
    """Refuse to write HDF5 under a name that says another format.

    Raises
    ------
    ValueError
    """
    if path.suffix in _OTHERS:
        msg = f"{path} ends in {path.suffix!r}, expected the name of an HDF5 file, such as {path.stem}.h5"
        raise ValueError(msg)


def real(path: PathLike) -> Path:
    """Follow links, so that all names of a file have the same temporary files and journal beside it."""
    return Path(os.path.realpath(path))


def _prefix(place: Path) -> str:
    return f".{place.name}.{os.uname().nodename}."


def remove_leftovers(path: PathLike) -> None:
    """Remove temporary files for `path` of processes of this machine that are no more."""
    place = real(path)
    prefix = _prefix(place)
    with suppress(OSError):  # of folders that are not there, of which the writer tells
        for name in (path.name for path in place.parent.iterdir()):
            pid = name.removeprefix(prefix).removesuffix(_END)
            if name == f"{prefix}{pid}{_END}" and pid.isdecimal() and not _is_alive(int(pid)):
                (place.parent / name).unlink(missing_ok=True)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return True
