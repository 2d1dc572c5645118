"""Files of runs survive kills, full disks, and one another: whatever happens, what is read is a prefix."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from jamshape.files.journal import journal_of, parse, remove_run
from jamshape.files.restarts import RestartFiles, is_whole
from jamshape.files.run_writer import RunWriter
from nasty import assert_identical, nasty_packing

from jamshape.files import disk, run_writer
from jamshape.files.h5md import (
    FileFormatError,
    count_frames,
    read_attributes,
    read_observables,
    read_packing,
    read_report,
    read_series,
    write_packing,
)

h5py = pytest.importorskip("h5py")

ROWS = 12  # of the run of these tests; every third one has a frame

KILLS = [pytest.param(30, id="few"), pytest.param(500, id="many", marks=pytest.mark.validate)]


def frame(step):
    first = nasty_packing(2)
    return first.with_(step=step, time=step / 3, position=first.position / (1 + step))


def begin(path):
    return RunWriter.create(path, frame(0), {"seen": 0, "of": "nobody"}, {"pressure": 0.0})


def go_on(writer, first, last):
    """Write rows up to one."""
    for step in range(first, last + 1):
        writer.append_observables(step, step / 3, {"pressure": step / 7}, (step / 11, 1 / step))
        if step % 3 == 0:
            writer.append(frame(step), {"motion": np.arange(6) * step})
        writer.set_attributes({"seen": step, "of": f"row {step}"})


def require_prefix(path, most=ROWS):
    """Check that a run is what was written up to some row, and return it."""
    with h5py.File(path) as file:  # as any other program opens it
        assert len(file["particles/all/position/value"]) == len(file["particles/all/position/step"])
    series, report, stored = read_series(path, "pressure"), read_report(path), read_attributes(path)
    last = int(series.step[-1])
    assert last <= most
    np.testing.assert_array_equal(series.step, np.arange(last + 1))
    np.testing.assert_array_equal(series.value, np.arange(last + 1) / 7)
    np.testing.assert_array_equal(report.step, np.arange(1, last + 1))
    frames = count_frames(path)
    assert frames in {last // 3 + 1, (last - 1) // 3 + 1}
    for k in {*range(min(frames, 5)), frames - 1}:
        assert_identical(read_packing(path, k), frame(3 * k))
    # Rows and attributes are records of their own, and so are rows that are dropped to go on.
    assert last - 1 <= stored["seen"] <= last + 2
    assert stored["of"] == (f"row {stored['seen']}" if stored["seen"] else "nobody")
    return last


def require_same(path, other):
    """Check that two runs hold the same."""
    one, two = read_observables(path), read_observables(other)
    assert one.keys() == two.keys()
    for name, values in one.items():
        np.testing.assert_array_equal(two[name], values)
    assert read_attributes(path) == read_attributes(other)
    np.testing.assert_array_equal(read_report(path), read_report(other))
    assert count_frames(path) == count_frames(other)


def resume(path):
    """Go on from the last frame to the end, as drivers do."""
    with RunWriter.open(path) as writer:
        start = read_packing(path).step
        writer.truncate(start)
        writer.set_attributes({"seen": start, "of": f"row {start}" if start else "nobody"})
        go_on(writer, start + 1, ROWS)


@pytest.fixture
def whole(tmp_path):
    path = tmp_path / "whole.h5"
    with begin(path) as writer:
        go_on(writer, 1, ROWS)
    return path


def test_a_finished_run_has_no_journal_and_no_trace_of_one(whole):
    assert require_prefix(whole) == ROWS
    assert [path.name for path in whole.parent.iterdir()] == ["whole.h5"]
    with h5py.File(whole) as file:
        assert not dict(file.attrs)


# --- cut at every byte -------------------------------------------------------------------------


def test_a_journal_may_be_cut_at_every_byte(whole, tmp_path):
    path = tmp_path / "cut.h5"
    writer = begin(path)
    go_on(writer, 1, ROWS)
    file, journal = path.read_bytes(), journal_of(path).read_bytes()
    writer.close()
    records, ends = parse(journal).records, []
    for end in range(len(journal) + 1):
        found = parse(journal[:end])
        count = len(found.records) if found else 0
        if count == len(ends):
            ends.append(end)  # the first byte with which so many records are whole
    assert len(ends) == len(records) + 1
    for end in sorted({*ends, *(end - 1 for end in ends[1:])}):
        path.write_bytes(file)
        journal_of(path).write_bytes(journal[:end])
        require_prefix(path)
        if end % 5 == 0:
            resume(path)
            require_same(path, whole)
            assert not journal_of(path).exists()


@pytest.mark.parametrize("byte", [0, 20, 60, 66, 90, 500, -1])
def test_what_follows_a_byte_that_changed_is_not_believed(byte, tmp_path):
    path = tmp_path / "changed.h5"
    writer = begin(path)
    go_on(writer, 1, 3)
    data = bytearray(journal_of(path).read_bytes())
    data[byte] ^= 0x10
    journal_of(path).write_bytes(data)
    assert require_prefix(path, 3) < 3 or byte == -1
    del writer


# --- interrupted between any two calls of the system -------------------------------------------


class Killed(BaseException):
    """Stands for the end of the process."""


CALLS = ("pwrite", "ftruncate", "fsync", "replace", "unlink")


class Fuse:
    """Ends the process, in effect, at one of its calls that change files; before, or half done."""

    def __init__(self, monkeypatch, at):
        self.left = at
        for name in CALLS:
            of = Path if name in {"replace", "unlink"} else os
            monkeypatch.setattr(of, name, self.around(getattr(of, name), name))

    def around(self, call, name):
        def called(*args, **options):
            self.left -= 1
            if self.left == 0 and name == "pwrite":
                call(args[0], args[1][: len(args[1]) // 2], args[2])
            if self.left <= 0:  # nothing works any more, cleaning up neither
                raise Killed
            return call(*args, **options)

        return called


def interrupted(path, at, monkeypatch):
    """Write a run with many folds until a call; return whether it came to its end."""
    writer = None
    try:
        with monkeypatch.context() as patch:
            patch.setattr("jamshape.files.run_writer._PART", 0.05)
            patch.setattr("jamshape.files.run_writer._PAUSE", 0)
            patch.setattr("jamshape.files.run_writer._SECONDS", 0)
            Fuse(patch, at)
            writer = begin(path)
            go_on(writer, 1, ROWS)
            writer.close()
    except Killed:
        if writer:
            writer._journal._close()
        return False
    return True


def test_a_run_may_end_at_every_call(whole, tmp_path, monkeypatch):
    path, last, ended, at = tmp_path / "ended.h5", 0, False, 0
    while not ended:
        at += 1
        remove_run(path)
        ended = interrupted(path, at, monkeypatch)
        if not path.exists():
            assert last == 0
            continue
        found = require_prefix(path)
        assert found >= last
        last = found
        resume(path)
        require_same(path, whole)
        left = {entry.name for entry in tmp_path.iterdir()} - {"whole.h5", "ended.h5"}
        assert all(f".{os.getpid()}." in name and name.endswith(".tmp") for name in left)
    assert last == ROWS
    assert at > 40


# --- killed at random moments ------------------------------------------------------------------


def write_until_killed(path):
    """Write rows for ever, with a fold after each few of them; never returns."""
    try:
        run_writer._PART, run_writer._PAUSE, run_writer._SECONDS = 0.05, 0, 0
        if path.exists():
            writer, start = RunWriter.open(path), read_packing(path).step
            writer.truncate(start)
            writer.set_attributes({"seen": start, "of": f"row {start}" if start else "nobody"})
        else:
            writer, start = begin(path), 0
        for step in range(start + 1, 10**9):
            go_on(writer, step, step)
    finally:
        os._exit(1)  # so that the process that was forked is not another pytest


@pytest.mark.parametrize("kills", KILLS)
def test_no_kill_damages_a_run(kills, tmp_path, measured):
    path, random, rows, longest = tmp_path / "killed.h5", np.random.default_rng(1), 0, 100
    for _ in range(kills):
        process = os.fork()
        if not process:
            write_until_killed(path)
        time.sleep(random.uniform(0, 0.1))
        os.kill(process, signal.SIGKILL)
        assert os.WIFSIGNALED(os.waitpid(process, 0)[1])
        if path.exists():
            found = require_prefix(path, 10**9)
            assert found >= rows - 3  # it goes on from the last frame
            rows = found if found < longest else remove_run(path) or 0
    if not path.exists():
        begin(path).close()
    with RunWriter.open(path) as writer:
        writer.truncate(0)
    assert {entry.name for entry in tmp_path.iterdir()} == {"killed.h5"}
    measured(kills=kills, rows=rows)


def test_a_row_costs_little(tmp_path, measured):
    """A row of a compression has 25 observables; opening the file for each took fifteen milliseconds."""
    observables = {f"observable_{k}": k / 7 for k in range(25)}
    seconds = []
    with RunWriter.create(tmp_path / "run.h5", frame(0), {}, observables) as writer:
        for step in range(1, 401):
            began = time.perf_counter()
            writer.append_observables(step, step / 3, observables, (step / 11, 1.0))
            seconds.append(time.perf_counter() - began)
        began = time.perf_counter()
    measured(row=np.median(seconds), all_rows=sum(seconds), end=time.perf_counter() - began)
    assert np.median(seconds) < 2e-3


# --- one writer, and readers -------------------------------------------------------------------


def test_a_second_writer_gets_a_sentence(tmp_path):
    path = tmp_path / "run.h5"
    sentence = "another process writes this run, expected to be the only one; wait for its end"
    with begin(path) as writer:
        for call in (RunWriter.open, begin):
            with pytest.raises(OSError, match=sentence):
                call(path)
        go_on(writer, 1, 1)
    assert require_prefix(path) == 1
    with RunWriter.open(path) as writer:
        go_on(writer, 2, 2)


def test_a_writer_that_is_forgotten_holds_no_lock(tmp_path):
    path = tmp_path / "run.h5"
    go_on(begin(path), 1, 2)
    with RunWriter.open(path) as writer:
        go_on(writer, 3, 4)
    assert require_prefix(path) == 4


def test_links_lead_to_one_journal(tmp_path):
    path, link = tmp_path / "run.h5", tmp_path / "link.h5"
    link.symlink_to(path)
    with begin(link) as writer:
        go_on(writer, 1, 1)
        with pytest.raises(OSError, match="another process writes this run"):
            RunWriter.open(path)
        assert require_prefix(path) == 1
    assert link.is_symlink()
    assert require_prefix(path) == 1


def test_a_file_that_another_program_writes_gets_a_sentence(whole):
    script = "import h5py, sys; f = h5py.File(sys.argv[1], 'r+'); print(1, flush=True); input()"
    command = [sys.executable, "-c", script, str(whole)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        process.stdout.readline()
        with pytest.raises(OSError, match="another program has it open for writing, expected"):
            read_packing(whole)
        process.communicate(b"\n")
    assert require_prefix(whole) == ROWS


def test_a_journal_of_a_file_that_was_replaced_is_not_believed(tmp_path):
    path = tmp_path / "run.h5"
    writer = begin(path)
    go_on(writer, 1, 4)
    write_packing(path, frame(0), {"seen": 0, "of": "nobody"}, {"pressure": 0.0})
    assert require_prefix(path) == 0
    with pytest.raises(FileFormatError, match="another program has replaced this file, expected"):
        writer.close()
    with RunWriter.open(path) as again:
        go_on(again, 1, 2)
    assert require_prefix(path) == 2


def test_a_file_without_rows_is_closed_as_it_was(whole):
    with RunWriter.open(whole):
        pass
    with RunWriter.open(whole) as writer:
        go_on(writer, ROWS + 1, ROWS + 1)
    assert require_prefix(whole, ROWS + 1) == ROWS + 1


def test_rows_of_one_kind_are_many_and_of_changing_kinds_too(tmp_path):
    path = tmp_path / "kinds.h5"
    with begin(path) as writer:
        for step in range(1, 40):
            some = {"pressure": step / 7} | ({"phi": step / 9} if step % 2 else {})
            writer.append_observables(step, step / 3, some)
        found = read_series(path, "phi")
    np.testing.assert_array_equal(found.step, np.arange(1, 40, 2))
    np.testing.assert_array_equal(read_series(path, "phi"), found)
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
    writer = begin(path)
    go_on(writer, 1, 6)
    ballast = small_disk / "ballast"
    with suppress(OSError), ballast.open("wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))
    with pytest.raises(OSError, match=FULL) as refused:
        go_on(writer, 7, 100_000)
    assert refused.value.errno == errno.ENOSPC
    last = require_prefix(path, 100_000)
    for write in (lambda: write_packing(packing, frame(8)), writer.close):
        with pytest.raises(OSError, match=FULL):
            write()
    assert_identical(read_packing(packing), frame(7))
    assert require_prefix(path, last) == last
    names = {entry.name for entry in small_disk.iterdir()}
    assert names == {"run.h5", "run.h5.journal", "packing.h5", "ballast"}
    ballast.unlink()
    with RunWriter.open(path) as again:
        go_on(again, last + 1, last + 1)
    assert require_prefix(path, last + 1) == last + 1


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
    for write in (write_packing, RunWriter.create):
        with pytest.raises(OSError, match=sentence):
            write(path, frame(0))


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


# --- LAMMPS's restart files --------------------------------------------------------------------

WHOLE = b"LammpS RestartT\0" + bytes(100) + b"LammpS RestartT\0"


def test_the_newest_restart_file_that_is_whole_is_taken(tmp_path):
    files = RestartFiles(tmp_path / "run.h5.restart")
    assert files.newest() is None
    a = files.next()
    a.write_bytes(WHOLE)
    os.utime(a, (1, 1))
    assert files.newest() == a
    b = files.next()
    assert b != a
    for end in range(len(WHOLE)):
        b.write_bytes(WHOLE[:end])
        assert not is_whole(b)
        assert files.newest() == a
        assert files.next() == b
    b.write_bytes(WHOLE)
    assert files.newest() == b
    files.forget()
    assert not list(tmp_path.iterdir())


# --- files of earlier versions -----------------------------------------------------------------


@pytest.mark.parametrize("version", [1, 2])
def test_a_file_of_an_earlier_version_goes_on(version, whole):
    with h5py.File(whole, "r+") as file:
        if version == 1:
            del file["h5md/creator"].attrs["format_version"]
            file.move("observables/pressure", "observables/p")
        # As killed in place: more values than steps.
        file["particles/all/position/value"].resize(ROWS // 3 + 2, axis=0)
    assert read_series(whole, "pressure").step[-1] == ROWS
    with RunWriter.open(whole) as writer:
        go_on(writer, ROWS + 1, ROWS + 3)
        assert require_prefix_of_old(whole) == ROWS + 3
    assert require_prefix(whole, ROWS + 3) == ROWS + 3


def require_prefix_of_old(path):
    return int(read_series(path, "pressure").step[-1])


def test_bytes_that_are_no_journal_are_none():
    assert parse(b"") is None
    assert parse(b"x" * 100) is None
