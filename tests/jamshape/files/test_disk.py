"""Files that are replaced as a whole."""

import errno
import os
import stat
import subprocess

import pytest

from jamshape.checks import require_path
from jamshape.files import disk
from jamshape.files.disk import remove_leftovers, replacing, store
from jamshape.files.lock import Lock

ANOTHER = 65534  # user and group
needs_root = pytest.mark.skipif(os.getuid() != 0, reason="only root gives files to others")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "packing.h5"


def names(path):
    return sorted(entry.name for entry in path.parent.iterdir())


def mode_of(path):
    return stat.S_IMODE(path.stat().st_mode)


@pytest.fixture
def umask():
    before = os.umask(0o027)
    yield
    os.umask(before)


# --- modes and owners ----------------------------------------------------------------------------


@pytest.mark.usefixtures("umask")
@pytest.mark.parametrize("mode", [0o600, 0o660, 0o640, 0o666, 0o604])
def test_the_mode_of_a_file_stays(path, mode):
    path.write_bytes(b"old")
    path.chmod(mode)
    with replacing(path) as temporary:
        assert mode_of(temporary) == mode  # from the beginning
        temporary.write_bytes(b"new")
    assert (path.read_bytes(), mode_of(path)) == (b"new", mode)


@pytest.mark.usefixtures("umask")
def test_a_new_file_has_the_mode_that_the_user_chose(path):
    store(path, b"new")
    assert mode_of(path) == 0o640


def test_the_mode_stays_where_a_writer_replaces_the_temporary_file(path):
    path.write_bytes(b"old")
    path.chmod(0o600)
    with replacing(path) as temporary:
        temporary.unlink()
        temporary.write_bytes(b"new")
    assert (path.read_bytes(), mode_of(path)) == (b"new", 0o600)


@needs_root
def test_the_owner_of_a_file_stays(path):
    path.write_bytes(b"old")
    path.chmod(0o664)
    os.chown(path, ANOTHER, ANOTHER)
    store(path, b"new")
    found = path.stat()
    assert (found.st_uid, found.st_gid, mode_of(path)) == (ANOTHER, ANOTHER, 0o664)


def test_a_file_whose_owner_would_change_is_refused(path, monkeypatch):
    def refused(*_):
        raise PermissionError(errno.EPERM, "Operation not permitted")

    path.write_bytes(b"old")
    of_another = os.stat_result((*path.stat()[:4], ANOTHER, ANOTHER, *path.stat()[6:]))
    monkeypatch.setattr(os, "fchown", refused)
    monkeypatch.setattr(disk, "require_replaceable", lambda _: of_another)
    with pytest.raises(OSError, match=r"packing\.h5: belongs to another user or group, expected"):
        store(path, b"new")
    assert path.read_bytes() == b"old"
    assert names(path) == ["packing.h5"]


@pytest.mark.parametrize("use", [Lock, lambda path: store(path, b"new")])
@pytest.mark.parametrize("mode", [0o444, 0o400, 0o000])
def test_a_write_protected_file_is_refused_also_for_root(path, mode, use):
    path.write_bytes(b"old")
    path.chmod(mode)
    sentence = r"packing\.h5: is write-protected, expected a file that may be replaced; change"
    with pytest.raises(OSError, match=sentence):
        use(path)
    assert names(path) == ["packing.h5"]
    path.chmod(0o600)
    assert path.read_bytes() == b"old"


def pipe(path):
    os.mkfifo(path)


@pytest.mark.parametrize("use", [Lock, lambda path: store(path, b"new")])
@pytest.mark.parametrize("make", [pipe, os.mkdir, lambda path: path.symlink_to(path)])
def test_what_is_not_a_file_is_left_alone(path, make, use):
    make(path)
    before = path.lstat()
    with pytest.raises(OSError, match=r"packing\.h5: is not a file, expected the name of a file"):
        use(path)
    assert path.lstat().st_ino == before.st_ino
    assert names(path) == ["packing.h5"]


# --- links ---------------------------------------------------------------------------------------


def test_the_target_of_a_link_is_replaced(path):
    target = path.with_name("target.h5")
    target.write_bytes(b"old")
    path.symlink_to(target)
    store(path, b"new")
    assert path.is_symlink()
    assert target.read_bytes() == b"new"


def test_a_link_at_the_name_of_a_temporary_file_is_not_followed(path, monkeypatch):
    other = path.with_name("other")
    other.write_bytes(b"to be kept")
    monkeypatch.setattr(disk.secrets, "token_hex", lambda _: "0" * 8)
    with replacing(path) as temporary:
        name = temporary.name
    path.unlink()
    path.with_name(name).symlink_to(other)
    with pytest.raises(OSError, match=r"packing\.h5: cannot be written \(File exists\)"):
        store(path, b"new")
    assert other.read_bytes() == b"to be kept"
    assert not path.exists()


def test_a_link_that_takes_the_place_of_a_temporary_file_is_not_followed(path):
    def swapped():
        with replacing(path) as temporary:
            temporary.unlink()
            temporary.symlink_to(other)

    other = path.with_name("other")
    other.write_bytes(b"to be kept")
    before = other.stat()
    with pytest.raises(OSError, match=r"packing\.h5: cannot be written \(Too many levels of"):
        swapped()
    assert other.stat() == before
    assert names(path) == ["other"]


# --- leftovers -----------------------------------------------------------------------------------


def left_by(pid, path):
    """Name a temporary file of another process."""
    with replacing(path) as temporary:
        name = temporary.name.replace(f".{os.getpid()}.", f".{pid}.")
    path.unlink()
    return path.with_name(name)


def test_links_among_leftovers_are_removed_and_not_followed(path):
    with subprocess.Popen(["true"]) as ended:
        pass
    other = path.with_name("other")
    other.write_bytes(b"to be kept")
    left_by(ended.pid, path).symlink_to(other)
    remove_leftovers(path)
    assert names(path) == ["other"]
    assert other.read_bytes() == b"to be kept"


def test_leftovers_of_a_process_that_nobody_waits_for_are_removed(path):
    """The first process of a container may wait late or never for those of a killed run."""
    process = subprocess.Popen(["sleep", "100"])
    left = left_by(process.pid, path)
    left.touch()
    remove_leftovers(path)
    assert left.exists()
    process.kill()
    os.waitid(os.P_PID, process.pid, os.WEXITED | os.WNOWAIT)  # and it stays as it is
    remove_leftovers(path)
    assert not left.exists()
    process.wait()


# --- syncs ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("wait", [True, False])
def test_a_file_is_synced_before_the_rename_and_its_folder_after_it(path, wait, monkeypatch):
    calls = []

    def synced(file):
        kind = "folder" if stat.S_ISDIR(os.fstat(file).st_mode) else "file"
        calls.append((kind, path.exists()))

    monkeypatch.setattr(os, "fsync", synced)
    store(path, b"new", wait=wait)
    assert calls == ([("file", False), ("folder", True)] if wait else [])


# --- names ---------------------------------------------------------------------------------------


def test_names_are_refused_where_names_of_files_beside_them_would_be_too_long(path):
    most = os.pathconf(path.parent, "PC_NAME_MAX") - 48
    for name in ("a" * most, "ü" * (most // 2)):
        fits = path.with_name(name)
        require_path(fits)
        with Lock(fits):
            store(fits, b"new")
        sentence = rf"the name of .* has \d+ bytes, expected at most {most}, since files beside it"
        with pytest.raises(ValueError, match=sentence):
            require_path(path.with_name(f"{name}bb"))
    link = path.with_name("link.h5")
    link.symlink_to(path.with_name("b" * (most + 1)))
    with pytest.raises(ValueError, match=r"has \d+ bytes, expected at most"):
        require_path(link)
