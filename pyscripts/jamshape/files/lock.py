"""Lock of a file that one process writes, in a file beside it, ``.NAME.lock``."""

from __future__ import annotations

import errno
import fcntl
import os
import stat
import warnings
import weakref
from contextlib import suppress
from pathlib import Path
from typing import Self

from jamshape.files.disk import PathLike, real, refusals, require_replaceable

NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP, errno.EOPNOTSUPP}
"""Errors of file systems without locks."""

_FLAGS = os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK


class NoLocksWarning(UserWarning):
    """A file system has no locks, so that two processes could write one file."""


class Lock:
    """Exclusive right to write a file, held until `release`.

    All names of a file, such as links, have one lock. It ends with the process that took it: a forked process
    neither holds nor releases it. Works as a context manager.

    Parameters
    ----------
    path : path-like
        File to write, which need not exist.

    Raises
    ------
    OSError
        If another process holds it, the folder is missing or not writable, or the file cannot be replaced
        (`require_replaceable`); the message is one sentence.

    Warns
    -----
    NoLocksWarning
        If the file system has no locks.
    """

    def __init__(self, path: PathLike) -> None:
        self._path = lock_of(path)
        self._file = -1
        require_replaceable(path)
        with refusals(path, self._path):
            self._file = _locked(self._path, path)
        _held.add(self)

    @property
    def is_held(self) -> bool:
        """Whether this process holds it."""
        return self._file >= 0

    def release(self) -> None:
        """Remove the lock's file and let others write; a second call does nothing."""
        if self.is_held:
            with suppress(OSError):  # an empty file that stays is harmless
                if _is_at(self._file, self._path):
                    self._path.unlink()
            self._close()

    def _close(self) -> None:
        file, self._file = self._file, -1
        os.close(file)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    def __del__(self) -> None:
        """Release a lock that was forgotten."""
        if hasattr(self, "_file"):
            self.release()


_held: weakref.WeakSet[Lock] = weakref.WeakSet()


def _close_all() -> None:
    """Close the locks of the process that this one was forked from, which keeps them."""
    for lock in list(_held):
        if lock.is_held:
            lock._close()


os.register_at_fork(after_in_child=_close_all)


def lock_of(path: PathLike) -> Path:
    """Name the file of a lock."""
    place = real(path)
    return place.with_name(f".{place.name}.lock")


def _locked(lock: Path, path: PathLike) -> int:
    """Open and lock the file of a lock."""
    while True:
        file = _opened(lock, path)
        try:
            has_locks = _flocked(file, path)
        except BaseException:
            os.close(file)
            raise
        # The holder before may have removed the file between these two calls.
        if not has_locks or _is_at(file, lock):
            return file
        os.close(file)


def _flocked(file: int, path: PathLike) -> bool:
    """Lock an open file; return False, with a warning, on file systems without locks."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as error:
        msg = (
            f"{path}: another process writes this file, expected to be the only one;"
            " wait for its end, or end it"
        )
        raise OSError(msg) from error
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        msg = (
            f"{path}: its file system has no locks, expected one where several processes could write a file;"
            " let only one write it"
        )
        warnings.warn(msg, NoLocksWarning, stacklevel=5)
        return False
    return True


def _opened(lock: Path, path: PathLike) -> int:
    """Open the file of a lock, not the target of a link."""
    try:
        file = os.open(lock, _FLAGS, 0o666)
    except OSError as error:
        if error.errno != errno.ELOOP:
            raise
        raise _refusal(path, lock, "a link") from error
    if stat.S_ISREG(os.fstat(file).st_mode):
        return file
    os.close(file)
    raise _refusal(path, lock, "not a file")


def _refusal(path: PathLike, lock: Path, found: str) -> OSError:
    return OSError(f"{path}: cannot be locked, since {lock} is {found}, expected a file; remove it")


def _is_at(file: int, path: Path) -> bool:
    """Whether an open file is the one at a path."""
    try:
        return os.path.samestat(os.fstat(file), path.lstat())
    except FileNotFoundError:
        return False
