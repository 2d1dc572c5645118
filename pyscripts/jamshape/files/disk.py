"""Atomic replacement of files: the previous content stays until the new one is safe on the disk.

A file is written under a temporary name in the same folder, ``.NAME.HOST.PID.tmp``, and takes its place by a
rename. A killed process leaves its temporary file behind; the next writer of the same file
removes it.
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PathLike = str | os.PathLike[str]

# Reasons of a disk or a folder to refuse writing.
_REFUSALS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO}

_END = ".tmp"

# Suffixes of formats other than HDF5.
_OTHERS = {".data", ".gsd", ".dump", ".png", ".pdf", ".csv", ".json", ".txt"}


@contextmanager
def replacing(path: PathLike) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, which takes its place if the body succeeds.

    If the body raises, the temporary file is removed and `path` is unchanged. If `path`
    is a link, its target is replaced.

    Raises
    ------
    OSError
        If the disk is full, or the folder is missing or not writable; the message is one sentence.
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
    """Write a whole file, synced to disk before it takes its place; errors as `replacing`.

    Short-lived files need not wait for the disk, and survive kills just as well.
    """
    with replacing(path) as temporary, temporary.open("wb") as file:
        file.write(data)
        file.flush()
        if wait:
            os.fsync(file.fileno())


@contextmanager
def refusals(path: PathLike, temporary: Path) -> Iterator[None]:
    """Turn errors of a disk or a folder that refuses a file into one sentence."""
    try:
        yield
    except OSError as error:
        if error.errno not in _REFUSALS and error.filename != str(temporary):
            raise
        msg = (
            f"{path}: cannot be written ({error.strerror}), expected a writable folder with room;"
            " make room or choose another, the previous content is unchanged"
        )
        refusal = OSError(msg)
        refusal.errno = error.errno  # for callers; only the message is printed
        raise refusal from error


def settled(path: PathLike | None) -> Path | None:
    """Make a path absolute, so that it stays valid when the working folder changes."""
    return None if path is None else Path(path).absolute()


def named(path: Path) -> str:
    """Shorten a path for messages: relative to the working folder, if inside it.

    Examples
    --------
    >>> named(Path.cwd() / "run.h5")
    'run.h5'
    """
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def require_hdf5_name(path: Path) -> None:
    """Refuse to write HDF5 under a suffix of another format.

    Raises
    ------
    ValueError
    """
    if path.suffix in _OTHERS:
        msg = f"{path} ends in {path.suffix!r}, expected the name of an HDF5 file, such as {path.stem}.h5"
        raise ValueError(msg)


def real(path: PathLike) -> Path:
    """Resolve links, so that all names of a file share temporary files and journal."""
    return Path(os.path.realpath(path))


def _prefix(place: Path) -> str:
    return f".{place.name}.{os.uname().nodename}."


def remove_leftovers(path: PathLike) -> None:
    """Remove temporary files for `path` left by dead processes of this machine."""
    place = real(path)
    prefix = _prefix(place)
    with suppress(OSError):  # missing folders, which the writer reports
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
