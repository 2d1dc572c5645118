"""Locks of files that one process writes."""

import errno
import fcntl
import os
import subprocess
import sys
import warnings
from pathlib import Path

import pytest

from jamshape.files.lock import Lock, NoLocksWarning, lock_of

OTHER = "another process writes this file, expected to be the only one; wait for its end, or end it"


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.h5"


def names(path):
    return sorted(entry.name for entry in path.parent.iterdir())


def open_files():
    return {entry.name for entry in Path("/proc/self/fd").iterdir()}


def test_one_holds_a_lock_and_leaves_no_trace(path):
    with Lock(path) as lock:
        assert lock.is_held
        assert names(path) == [".run.h5.lock"]
        with pytest.raises(OSError, match=OTHER) as refused:
            Lock(path)
        assert str(refused.value) == f"{path}: {OTHER}"
    assert not lock.is_held
    assert names(path) == []
    lock.release()
    with Lock(path):
        pass


def test_a_lock_that_is_forgotten_is_released(path):
    Lock(path)
    with Lock(path):
        pass


def test_all_names_of_a_file_have_one_lock(path):
    path.write_bytes(b"")
    link = path.with_name("link.h5")
    link.symlink_to(path)
    with Lock(link), pytest.raises(OSError, match=OTHER):
        Lock(path)
    assert names(path) == ["link.h5", "run.h5"]


HOLD = """
import os, sys
from jamshape.files.lock import Lock
lock = Lock(sys.argv[1])
{}
os.write(1, b"held\\n")
sys.stdin.read()
os._exit(0)
"""


def holder(path, more=""):
    command = [sys.executable, "-c", HOLD.format(more), str(path)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdout.readline() == b"held\n"
    return process


def test_a_lock_ends_with_its_process(path):
    with holder(path) as process:
        with pytest.raises(OSError, match=OTHER):
            Lock(path)
        process.kill()
    assert names(path) == [".run.h5.lock"]
    with Lock(path):
        pass
    assert names(path) == []


def test_forked_processes_neither_release_nor_hold_a_lock(path):
    fork = "if not os.fork(): lock.release(); del lock; os.write(1, b'forked\\n'); sys.stdin.read(); os._exit(0)"
    command = [sys.executable, "-c", HOLD.format(fork), str(path)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert {process.stdout.readline() for _ in range(2)} == {b"held\n", b"forked\n"}
        with pytest.raises(OSError, match=OTHER):
            Lock(path)
        process.kill()
        process.wait()
        with Lock(path):  # while the forked one is alive
            pass


def test_a_lock_that_was_removed_between_opening_and_locking_is_taken_anew(path, monkeypatch):
    calls = []

    def removed_first(file, how):
        calls.append(how)
        if len(calls) == 1:
            lock_of(path).unlink()
        flock(file, how)

    flock = fcntl.flock
    monkeypatch.setattr(fcntl, "flock", removed_first)
    with Lock(path), pytest.raises(OSError, match=OTHER):
        Lock(path)
    assert len(calls) == 3


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOTSUP, errno.ENOSYS])
def test_file_systems_without_locks_are_written_with_a_warning(path, code, monkeypatch):
    def refused(*_):
        raise OSError(code, os.strerror(code))

    monkeypatch.setattr(fcntl, "flock", refused)
    with pytest.warns(NoLocksWarning, match=r"run\.h5: its file system has no locks, expected"):
        lock = Lock(path)
    lock.release()
    assert names(path) == []


def test_other_errors_of_a_lock_are_raised_and_leave_nothing_open(path, monkeypatch):
    def refused(*_):
        raise OSError(errno.EIO, "Input/output error")

    monkeypatch.setattr(fcntl, "flock", refused)
    before = open_files()
    with pytest.raises(OSError, match=r"run\.h5: cannot be written \(Input/output error\)"):
        Lock(path)
    assert open_files() == before


def test_links_and_pipes_at_the_name_of_a_lock_are_left_alone(path):
    other = path.with_name("other")
    for make in (lambda lock: lock.symlink_to(other), os.mkfifo):
        make(lock_of(path))
        with pytest.raises(OSError, match=r"run\.h5: cannot be locked, since .* expected a file"):
            Lock(path)
        assert names(path) == [".run.h5.lock"]
        lock_of(path).unlink()


def test_a_folder_that_is_missing_gets_a_sentence(tmp_path):
    with pytest.raises(OSError, match=r"cannot be written \(No such file or directory\), expected"):
        Lock(tmp_path / "none" / "run.h5")


def test_a_folder_that_is_read_only_gets_a_sentence(path, monkeypatch):
    if not os.getuid():  # root may write everywhere
        error = PermissionError(errno.EACCES, "Permission denied", str(lock_of(path)))
        monkeypatch.setattr(os, "open", lambda *_: (_ for _ in ()).throw(error))
    else:
        path.parent.chmod(0o500)
    with pytest.raises(
        OSError, match=r"cannot be written \(Permission denied\), expected a writable"
    ):
        Lock(path)


def test_a_warning_that_is_an_error_leaves_no_lock(path, monkeypatch):
    def refused(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refused)
    before = open_files()
    with warnings.catch_warnings(action="error"), pytest.raises(NoLocksWarning):
        Lock(path)
    assert open_files() == before
