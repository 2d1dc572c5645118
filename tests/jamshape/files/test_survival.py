"""Files survive kills and full disks: whatever happens, what is read is what was written at some time."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest
from nasty import assert_identical, nasty_packing
from written import write_content

from jamshape.files import disk
from jamshape.files.h5md import (
    count_frames,
    read_attributes,
    read_packing,
    read_report,
    read_series,
    write_packing,
)

ROWS = 12  # of the run of these tests; every third one has a frame

KILLS = [pytest.param(15, id="few"), pytest.param(500, id="many", marks=pytest.mark.validate)]


def frame(step):
    first = nasty_packing(2)
    return first.with_(step=step, time=step / 3, position=first.position / (1 + step))


def write_run_to(path, last):
    """Write a run with rows up to one."""
    frames = [frame(step) for step in range(0, last + 1, 3)]
    rows = [(step, step / 3, {"pressure": step / 7}) for step in range(last + 1)]
    report = [(step, step / 11, 1 / step) for step in range(1, last + 1)]
    return write_content(path, frames, {"seen": last, "of": f"row {last}"}, rows, report)


def require_prefix(path):
    """Check that a run is what was written up to some row, and return it."""
    with h5py.File(path) as file:  # as any other program opens it
        assert len(file["particles/all/position/value"]) == len(file["particles/all/position/step"])
    series, report, stored = read_series(path, "pressure"), read_report(path), read_attributes(path)
    last = int(series.step[-1])
    np.testing.assert_array_equal(series.step, np.arange(last + 1))
    np.testing.assert_array_equal(series.value, np.arange(last + 1) / 7)
    np.testing.assert_array_equal(report.step, np.arange(1, last + 1))
    assert count_frames(path) == last // 3 + 1
    for k in range(last // 3 + 1):
        assert_identical(read_packing(path, k), frame(3 * k))
    assert stored == {"seen": last, "of": f"row {last}"}
    return last


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "whole.h5"
    write_run_to(path, ROWS)
    return path


# --- interrupted between any two calls of the system -------------------------------------------


class Killed(BaseException):
    """Stands for the end of the process."""


CALLS = ("open", "fsync", "replace", "unlink")


class Fuse:
    """Ends the process, in effect, before one of its calls that change files."""

    def __init__(self, monkeypatch, at):
        self.left = at
        for name in CALLS:
            of = Path if name in {"replace", "unlink"} else os
            monkeypatch.setattr(of, name, self.around(getattr(of, name)))

    def around(self, call):
        def called(*args, **options):
            self.left -= 1
            if self.left <= 0:  # nothing works any more, cleaning up neither
                raise Killed
            return call(*args, **options)

        return called


def test_a_file_may_be_cut_off_at_every_call(whole, monkeypatch):
    at, rows, ended = 0, [], False
    while not ended:
        at += 1
        write_run_to(whole, 3)
        with monkeypatch.context() as patch, suppress(Killed):
            Fuse(patch, at)
            write_run_to(whole, 6)
            ended = True
        rows.append(require_prefix(whole))
        left = {entry.name for entry in whole.parent.iterdir()} - {whole.name}
        assert all(f".{os.getpid()}." in name and name.endswith(".tmp") for name in left)
    assert rows == sorted(rows)
    assert {*rows} == {3, 6}
    assert at > 4


# --- killed at random moments ------------------------------------------------------------------


def write_until_killed(path):
    """Write runs for ever; never returns."""
    try:
        for row in range(10**9):
            write_run_to(path, row % (2 * ROWS))
    finally:
        os._exit(1)  # so that the process that was forked is not another pytest


@pytest.mark.parametrize("kills", KILLS)
def test_no_kill_damages_a_run(kills, tmp_path, measured):
    path, random = tmp_path / "killed.h5", np.random.default_rng(1)
    for _ in range(kills):
        process = os.fork()
        if not process:
            write_until_killed(path)
        time.sleep(random.uniform(0, 0.1))
        os.kill(process, signal.SIGKILL)
        assert os.WIFSIGNALED(os.waitpid(process, 0)[1])
        if path.exists():
            require_prefix(path)
    write_run_to(path, 3)
    assert {entry.name for entry in tmp_path.iterdir()} == {"killed.h5"}
    measured(kills=kills)


# --- one writer, and readers -------------------------------------------------------------------


def test_a_file_that_another_program_writes_gets_a_sentence(whole):
    script = "import h5py, sys; f = h5py.File(sys.argv[1], 'r+'); print(1, flush=True); input()"
    command = [sys.executable, "-c", script, str(whole)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        with pytest.raises(OSError, match="another program has it open for writing, expected"):
            read_packing(whole)
        process.communicate(b"\n")
    assert require_prefix(whole) == ROWS


def test_rows_of_changing_kinds_each_have_their_steps(tmp_path):
    path = tmp_path / "kinds.h5"
    rows = [
        (step, step / 3, {"pressure": step / 7} | ({"phi": step / 9} if step % 2 else {}))
        for step in range(40)
    ]
    write_content(path, [frame(0)], rows=rows)
    np.testing.assert_array_equal(read_series(path, "phi").step, np.arange(1, 40, 2))
    np.testing.assert_array_equal(read_series(path, "pressure").step, np.arange(40))


# --- disks -------------------------------------------------------------------------------------


@pytest.fixture
def small_disk(tmp_path):
    """A disk of a megabyte, where the machine lets us make one."""
    folder = tmp_path / "disk"
    folder.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(folder)]
    if os.getuid() or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("this user may mount no small disk")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


FULL = r"cannot be written \(No space left on device\), expected a writable folder with room"


def test_a_full_disk_leaves_the_run_and_the_packing_as_they_were(small_disk):
    path, packing = small_disk / "run.h5", small_disk / "packing.h5"
    write_packing(packing, frame(7))
    write_run_to(path, 6)
    ballast = small_disk / "ballast"
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))
    for write in (lambda: write_packing(packing, frame(8)), lambda: write_run_to(path, 9)):
        with pytest.raises(OSError, match=FULL) as refused:
            write()
        assert refused.value.errno == errno.ENOSPC
    assert_identical(read_packing(packing), frame(7))
    assert require_prefix(path) == 6
    assert {entry.name for entry in small_disk.iterdir()} == {"run.h5", "packing.h5", "ballast"}
    ballast.unlink()
    write_run_to(path, 9)
    assert require_prefix(path) == 9


TOO_LARGE = """
import resource, signal, sys
path, *sys.path = sys.argv[1:]
from jamshape.command import sentences
from test_survival import frame, write_packing
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (4000, 4000))
with sentences("writer"):
    write_packing(path, frame(8))
"""


def test_a_file_that_may_not_grow_ends_the_program_with_a_sentence(tmp_path):
    path = tmp_path / "packing.h5"
    write_packing(path, frame(7))
    command = [sys.executable, "-c", TOO_LARGE, str(path), *sys.path]
    ended = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ended.returncode == 1
    assert ended.stderr.startswith(f"writer: {path}: cannot be written (File too large), expected")
    assert ended.stderr.count("\n") == 1
    assert_identical(read_packing(path), frame(7))
    assert [entry.name for entry in tmp_path.iterdir()] == ["packing.h5"]
    assert resource.getrlimit(resource.RLIMIT_FSIZE)[0] != 4000


def test_a_folder_that_is_not_there_gets_a_sentence(tmp_path):
    path = tmp_path / "none" / "packing.h5"
    sentence = (
        r"packing\.h5: cannot be written \(No such file or directory\), expected a writable folder"
    )
    with pytest.raises(OSError, match=sentence):
        write_packing(path, frame(0))


def test_temporary_files_of_dead_processes_are_removed(tmp_path):
    path = tmp_path / "[1] packing.h5"
    with subprocess.Popen(["true"]) as ended:
        pass
    with disk.replacing(path) as temporary:
        host = temporary.name.removeprefix(f".{path.name}.").split(".")[0]
    end = "01234567.tmp"
    dead = tmp_path / f".{path.name}.{host}.{ended.pid}.{end}"
    kept = [
        tmp_path / f".{path.name}.{host}.{os.getppid()}.{end}",
        tmp_path / f".{path.name}.{'0' * 8}.{ended.pid}.{end}",  # of another machine
        tmp_path / f".other.h5.{host}.{ended.pid}.{end}",
        tmp_path / f".{path.name}.{host}.{ended.pid}.tmp",
    ]
    for place in (dead, *kept):
        place.write_bytes(b"half")
    write_packing(path, frame(0))
    assert {*tmp_path.iterdir()} == {path, *kept}


def test_other_errors_of_a_body_are_left_alone(tmp_path):
    def body():
        with disk.replacing(tmp_path / "x.h5") as temporary:
            temporary.write_bytes(b"x")
            (tmp_path / "source").read_bytes()

    with pytest.raises(FileNotFoundError, match="source"):
        body()
    assert not list(tmp_path.iterdir())
