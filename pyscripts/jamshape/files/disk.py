"""Atomic replacement of files: the previous content stays until the new one is safe on the disk.

A file is written under a temporary name in the same folder, ``.NAME.HOST.PID.RANDOM.tmp``, and takes its place by a
rename, with the mode and the owner of the file that it replaces. HOST is a digest of the machine's name. The temporary
file is new, so that nobody can place a link at its name. A killed process leaves its temporary file behind; the next
writer of the same file removes it.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

PathLike = str | os.PathLike[str]

# Reasons of a disk or a folder to refuse writing.
_REFUSALS = {errno.ENOSPC, errno.EDQUOT, errno.EROFS, errno.EFBIG, errno.EIO}

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC

# Suffixes of formats other than HDF5: of particles, of numbers, of pictures, and of compressed files.
_OTHERS = {
    *(".data", ".dump", ".lammpstrj", ".gsd", ".xyz", ".extxyz", ".pdb", ".cif", ".vtk", ".ovito"),
    *(".txt", ".csv", ".dat", ".json", ".yaml", ".npy", ".npz", ".pkl", ".gz", ".zst"),
    *(".png", ".jpg", ".jpeg", ".pdf", ".svg", ".eps", ".gif", ".mp4", ".m4v", ".mkv", ".mov"),
}


class FileFormatError(ValueError):
    """A file has unexpected content; the message names the file."""


@contextmanager
def replacing(path: PathLike, *, wait: bool = True) -> Iterator[Path]:
    """Yield a temporary path in the folder of `path`, which takes its place if the body succeeds.

    If the body raises, the temporary file is removed and `path` is unchanged. If `path`
    is a link, its target is replaced, with its mode and owner.

    Parameters
    ----------
    path : path-like
    wait : bool
        Whether to sync the file and its folder to disk. Short-lived files need not wait for the disk, and
        survive kills just as well.

    Raises
    ------
    OSError
        If the disk is full, the folder is missing or not writable, or `path` is write-protected or not a file;
        the message is one sentence.
    """
    before, place = require_replaceable(path), real(path)
    remove_leftovers(place)
    name = f"{_prefix(place)}{os.getpid()}.{secrets.token_hex(4)}.tmp"
    temporary = place.with_name(name)
    with refusals(path, temporary):
        try:
            os.close(os.open(temporary, _NEW, 0o600 if before else 0o666))
            _settle(path, temporary, before, wait=False)
            yield temporary
            _settle(path, temporary, before, wait=wait)
            temporary.replace(place)
        finally:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
        if wait:
            _sync_folder(place.parent)


def store(path: PathLike, data: bytes | memoryview, *, wait: bool = True) -> None:
    """Write a whole file; parameters and errors as `replacing`."""
    with replacing(path, wait=wait) as temporary, temporary.open("wb") as file:
        file.write(data)


def require_replaceable(path: PathLike) -> os.stat_result | None:
    """Refuse a path that `replacing` cannot replace, before a long calculation begins.

    Returns
    -------
    os.stat_result or None
        Status of the file; None if there is none.

    Raises
    ------
    OSError
        If it is not a file, or write-protected, also for root.
    """
    place = real(path)
    try:
        found = place.lstat()
    except OSError:  # missing, or in a folder that the writer reports
        return None
    if not stat.S_ISREG(found.st_mode):
        msg = f"{path}: is not a file, expected the name of a file to write; choose another name"
        raise OSError(msg)
    may_write = os.access(place, os.W_OK) or os.statvfs(place).f_flag & os.ST_RDONLY
    if not found.st_mode & 0o222 or not may_write:
        msg = (
            f"{path}: is write-protected, expected a file that may be replaced;"
            " change its permissions, or write to another file"
        )
        raise OSError(msg)
    return found


def _settle(path: PathLike, temporary: Path, before: os.stat_result | None, *, wait: bool) -> None:
    """Give a file the mode and the owner of the one that it replaces, and sync it to disk."""
    file = os.open(temporary, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        if before:
            _keep_owner(path, file, before)
        if wait:
            os.fsync(file)
    finally:
        os.close(file)


def _keep_owner(path: PathLike, file: int, before: os.stat_result) -> None:
    now, mode = os.fstat(file), stat.S_IMODE(before.st_mode)
    if (now.st_uid, now.st_gid) != (before.st_uid, before.st_gid):
        try:
            os.fchown(file, before.st_uid, before.st_gid)
        except PermissionError as error:
            msg = (
                f"{path}: belongs to another user or group, expected a file of this user, since replacing it would"
                " change its owner; write to another file"
            )
            raise OSError(msg) from error
    if stat.S_IMODE(now.st_mode) != mode:
        os.fchmod(file, mode)


def _sync_folder(folder: Path) -> None:
    """Sync the names in a folder to disk, where the file system can."""
    with suppress(OSError):
        file = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
        try:
            os.fsync(file)
        finally:
            os.close(file)


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
    if path.suffix.lower() in _OTHERS:
        msg = (
            f"{path} ends in {path.suffix!r}, expected the name of an HDF5 file, such as {path.stem}.h5; for other"
            " formats use js.save or jamshape export afterwards"
        )
        raise ValueError(msg)


def real(path: PathLike) -> Path:
    """Resolve links, so that all names of a file share temporary files and journal."""
    return Path(os.path.realpath(path))


def _prefix(place: Path) -> str:
    host = hashlib.blake2b(os.uname().nodename.encode(), digest_size=4).hexdigest()
    return f".{place.name}.{host}."


def remove_leftovers(path: PathLike) -> None:
    """Remove temporary files for `path` left by dead processes of this machine."""
    place = real(path)
    form = re.compile(rf"{re.escape(_prefix(place))}(\d+)\.[0-9a-f]{{8}}\.tmp")
    with suppress(OSError):  # missing folders, which the writer reports
        for name in (path.name for path in place.parent.iterdir()):
            found = form.fullmatch(name)
            if found and not _is_alive(int(found[1])):
                (place.parent / name).unlink(missing_ok=True)


def _is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except (PermissionError, OverflowError):
        return True
    return not _has_ended(pid)


def _has_ended(pid: int) -> bool:
    """Recognise a process that has ended and that nobody has waited for, which may stay in a container."""
    try:
        stat = Path(f"/proc/{pid}/stat").read_text()
    except OSError:  # gone meanwhile, or a system without /proc
        return False
    return stat.rpartition(")")[2].split()[0] in {"Z", "X"}
