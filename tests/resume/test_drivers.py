"""What the recorder promises of every driver: the same bits however a run is put down, and never two runs in a file."""

from __future__ import annotations

import importlib
import os
import random
import resource
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import h5py
import in_process
import pytest
from drivers import (
    CASES,
    DRIVERS,
    EVERY,
    FAR,
    NONE,
    RODS,
    SHORT,
    dense,
    resume,
    run_case,
    started,
    write_start,
)
from killing import CALLS, differences, ended, forked, light, said
from thinned import in_turn, quick

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.files.content import Content
from jamshape.files.h5md import FileFormatError, read_attributes

pytestmark = pytest.mark.lammps

OTHER = "another process writes this file, expected to be the only one"
RECORDED = ("shear in LAMMPS", "quasistatic shear")
"""Drivers of the default suite where the recorder alone is at work, the same for all; the others are validated."""
ALONE = {"run.h5", "said.log"}  # what a run in a process of its own leaves


@pytest.fixture(scope="module")
def starts(tmp_path_factory):
    """The folder of starts."""
    return tmp_path_factory.mktemp("starts")


@pytest.fixture
def patched(monkeypatch):
    def patch(*patches):
        for name, value in patches:
            module, constant = name.rsplit(".", 1)
            monkeypatch.setattr(importlib.import_module(module), constant, value)

    return patch


@pytest.fixture(scope="module")
def whole(tmp_path_factory, starts):
    """Runs of cases without a checkpoint, each in a process of its own."""
    made = {}

    def of(name):
        if name not in made:
            folder = tmp_path_factory.mktemp("whole")
            made[name] = folder / "run.h5"
            code = ended(started(name, made[name], starts, NONE))
            assert code == 0, said(folder)
        return made[name]

    return of


class Marked(NamedTuple):
    """A run of a case with a checkpoint at every mark."""

    file: Path
    seconds: float
    """How long it took."""
    calls: int
    """How many calls changed files."""


@pytest.fixture(scope="module")
def marked(tmp_path_factory, starts):
    """Runs of cases with a checkpoint at every mark, in this process."""
    made = {}

    def of(name):
        if name not in made:
            file = tmp_path_factory.mktemp("marked") / "run.h5"
            began = time.monotonic()
            with pytest.MonkeyPatch.context() as patch:
                for key, value in (*SHORT, *EVERY):
                    module, constant = key.rsplit(".", 1)
                    patch.setattr(importlib.import_module(module), constant, value)
                for call in CALLS:  # `light` wraps them
                    patch.setattr(os, call, getattr(os, call))
                calls = light(0)
                CASES[name].run(file, starts)
            made[name] = Marked(file, time.monotonic() - began, len(calls))
        return made[name]

    return of


def require_same(expected, found):
    """Both files hold the same bits but for clocks."""
    assert not differences(expected, found, without=())


def names(folder):
    return {path.name for path in folder.iterdir()}


def unfinished(name, file, starts):
    """Put a run down at its first mark."""
    with pytest.raises(TimeLimitError, match=r"stopped after .* the same command resumes"):
        CASES[name].run(file, starts, seconds=0.0)
    assert not Content.read(file).attributes["finished"]


# --- the same bits --------------------------------------------------------------------------------


@pytest.mark.parametrize("name", quick(CASES, RECORDED))
def test_checkpoints_do_not_change_a_run(name, whole, marked):
    """In a process of its own without any, and here with one at every mark."""
    require_same(whole(name), marked(name).file)
    assert read_attributes(whole(name))["finished"]


@pytest.mark.parametrize("name", quick(CASES, {*DRIVERS, "shear in space"}))
def test_a_run_put_down_at_every_mark_ends_as_if_it_were_not(
    name, whole, starts, tmp_path, patched
):
    patched(*SHORT, *NONE)
    file, stops = tmp_path / "run.h5", 0
    while not file.exists() or not read_attributes(file)["finished"]:
        with suppress(TimeLimitError):
            if stops % 2 and file.exists():
                js.resume(file, seconds=0.0, progress=False)
            else:
                CASES[name].run(file, starts, seconds=0.0)
        stops += 1
    assert stops > 1 or name == "implicit compression at two rates"
    require_same(whole(name), file)
    assert names(tmp_path) == {"run.h5"}


# --- kills ----------------------------------------------------------------------------------------


def wait_for(path):
    deadline = time.monotonic() + 60
    while not path.exists() and time.monotonic() < deadline:
        time.sleep(0.005)


def kill_and_compare(name, marked, starts, folder, kills, seed):
    """Kill a run at random moments and in calls that change files, and let it end; return the number of kills."""
    expected, seconds, calls = marked(name)
    file, rng, count = folder / "run.h5", random.Random(seed), 0
    for k in range(kills):
        # The first one when its file holds the start alone, then every second one between two calls.
        fuse = rng.randrange(1, calls + 1) if k % 2 else 0
        process = started(name, file, starts, EVERY if k else NONE, fuse)
        if k:
            code = ended(process, 120 if fuse else rng.uniform(0, seconds))
        else:
            wait_for(file)
            code = ended(process, 0)
        if code == 0:
            break
        assert code == -signal.SIGKILL, said(folder)
        count += 1
        if file.exists():
            Content.read(file)
    # By the same call, or by the file alone.
    last = (resume, (file,)) if file.exists() and seed % 2 else (run_case, (name, file, starts, {}))
    assert ended(forked(*last, folder / "said.log", SHORT)) == 0, said(folder)
    require_same(expected, file)
    left = {path for path in names(folder) - ALONE if not path.startswith(".run.h5.lock")}
    assert not left
    return count


@pytest.mark.parametrize("name", quick(CASES, RECORDED))
def test_a_run_that_is_killed_ends_as_if_nothing_had_happened(
    name, marked, starts, tmp_path, measured
):
    kills = 3 if name in DRIVERS else 2
    measured(kills=kill_and_compare(name, marked, starts, tmp_path, kills, seed=len(name)))


@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_hundreds_of_kills(name, marked, starts, tmp_path, measured):
    """No file is damaged, no row lost or repeated: five kills a run until there are enough, with commands 300."""
    count = runs = 0
    while count < 15:
        runs += 1
        folder = tmp_path / str(runs)
        folder.mkdir()
        count += kill_and_compare(name, marked, starts, folder, kills=5, seed=runs)
        assert runs < 30, "hardly any run is killed before it ends"
    measured(kills=count, runs=runs)


# --- signals --------------------------------------------------------------------------------------


def going(name, file, starts, patches, **more):
    """Start a long run and wait until it has its file."""
    process = started(name, file, starts, patches, **dict(CASES[name].long) | more)
    wait_for(file)
    assert process.exitcode is None, said(file.parent)
    return process


# An interrupt ends Python by a KeyboardInterrupt.
SIGNALS = [(signal.SIGINT, 1), (signal.SIGTERM, -signal.SIGTERM)]


@pytest.mark.parametrize(("name", "signal_and_code"), in_turn([*DRIVERS], SIGNALS))
def test_a_signal_ends_a_run_at_its_next_mark(name, signal_and_code, starts, tmp_path):
    number, code = signal_and_code
    file = tmp_path / "run.h5"
    process = going(name, file, starts, EVERY)
    os.kill(process.pid, number)
    assert ended(process) == code
    text = said(tmp_path)
    assert "stopping at the next checkpoint; once more ends at once" in text
    assert ("KeyboardInterrupt" in text) == (number == signal.SIGINT)
    stopped = Content.read(file)
    assert not stopped.attributes["finished"]
    assert stopped.checkpoint
    assert names(tmp_path) == ALONE


@pytest.mark.parametrize(("name", "signal_and_code"), in_turn([*DRIVERS], SIGNALS[::-1]))
def test_a_second_signal_ends_a_run_at_once(name, signal_and_code, starts, tmp_path):
    """Even if there is no mark for minutes."""
    number, code = signal_and_code
    file = tmp_path / "run.h5"
    process = going(name, file, starts, (*FAR, *NONE))
    time.sleep(0.2)
    began = time.monotonic()
    while process.exitcode is None and time.monotonic() < began + 60:
        with suppress(ProcessLookupError):
            os.kill(process.pid, number)
        process.join(0.05)
    assert process.exitcode == code, said(tmp_path)
    assert names(tmp_path) - {".run.h5.lock"} <= ALONE


# --- two runs on one file -------------------------------------------------------------------------


@pytest.mark.parametrize("name", quick(DRIVERS, RECORDED))
def test_a_second_start_is_one_sentence_and_changes_nothing(name, starts, tmp_path):
    file, link = tmp_path / "run.h5", tmp_path / "a link"
    link.symlink_to(file)
    process = going(name, file, starts, EVERY)
    os.kill(process.pid, signal.SIGSTOP)
    before = file.read_bytes(), names(tmp_path)
    for path in (file, link):
        for more in ({}, {"again": True}, dict(CASES[name].long)):
            with pytest.raises(OSError, match=OTHER) as refused:
                CASES[name].run(path, starts, **more)
            assert "\n" not in str(refused.value)
        with pytest.raises(OSError, match=OTHER):
            js.resume(path, progress=False)
    assert before == (file.read_bytes(), names(tmp_path))
    process.kill()
    process.join()


@pytest.mark.parametrize("name", quick(DRIVERS, RECORDED))
def test_two_starts_with_other_settings_never_mix(name, marked, starts, tmp_path, patched):
    """Both at once, killed, and then both again: one file, one run."""
    expected, seconds, _ = marked(name)
    file, (key, value) = tmp_path / "run.h5", next(iter(CASES[name].others.items()))
    both = [started(name, file, starts, EVERY, **more) for more in ({}, {key: value})]
    time.sleep(max(0.5, seconds / 2))
    for process in both:
        process.kill()
        process.join()
    text = said(tmp_path) if (tmp_path / "said.log").exists() else ""
    patched(*SHORT)
    refusals = 0
    for more in ({}, {key: value}):
        try:
            CASES[name].run(file, starts, **more)
        except ValueError as error:
            refusals += 1
            assert "holds a" in str(error)  # noqa: PT017 - one of both
    assert refusals == 1
    assert "Traceback" not in text or OTHER in text or "holds a" in text
    alone = tmp_path / "alone.h5"
    if differences(expected, file, without=()):
        CASES[name].run(alone, starts, **{key: value})
        require_same(alone, file)


@pytest.mark.parametrize(("name", "state"), in_turn([*DRIVERS], ["unfinished", "finished"]))
def test_other_settings_are_refused_by_name(name, state, whole, starts, tmp_path, patched):
    patched(*SHORT, *NONE)
    file = whole(name) if state == "finished" else tmp_path / "run.h5"
    if state == "unfinished":
        unfinished(name, file, starts)
    before = file.read_bytes()
    for key, value in CASES[name].others.items():
        with pytest.raises(ValueError, match=r"holds a .*, expected .*; .* use again") as refused:
            CASES[name].run(file, starts, **{key: value})
        assert "\n" not in str(refused.value)
        assert f" with {key}" in str(refused.value), key
    assert file.read_bytes() == before


@pytest.mark.parametrize("name", DRIVERS)
def test_another_start_is_refused(name, whole, starts):
    phi = CASES[name].settings.get("phi")
    more = {"phi": (phi[0] + 0.01, phi[1])} if phi else {"start": dense(RODS, 12, 0.83)}
    with pytest.raises(ValueError, match=r"holds a .* with (phi_start|start|alpha)=.*, expected"):
        CASES[name].run(whole(name), starts, **more)


def test_another_packing_of_the_same_density_is_refused(tmp_path):
    packing, file = dense(RODS, 12, 0.82), tmp_path / "run.h5"
    how = {"step": 0.05, "strain": 0.1, "file": file, "progress": False}
    js.quasistatic_shear(start=packing, **how)
    js.quasistatic_shear(start=packing, **how)
    turned = packing.with_(orientation=packing.orientation + 0.1)
    with pytest.raises(
        ValueError, match=r"holds a quasistatic shear with start=packing \w+, expected"
    ):
        js.quasistatic_shear(start=turned, **how)


@pytest.mark.parametrize("name", quick(DRIVERS, RECORDED))
def test_again_begins_anew(name, whole, starts, tmp_path, patched):
    patched(*SHORT)
    file, (key, value) = tmp_path / "run.h5", next(iter(CASES[name].others.items()))
    with pytest.raises(TimeLimitError):
        CASES[name].run(file, starts, seconds=0.0, **{key: value})
    CASES[name].run(file, starts, again=True)
    require_same(whole(name), file)
    with pytest.raises(TimeLimitError):
        CASES[name].run(file, starts, again=True, seconds=0.0)
    assert not read_attributes(file)["finished"]


@pytest.mark.parametrize("name", DRIVERS)
def test_a_finished_run_is_loaded_and_left_alone(name, whole, starts):
    file = whole(name)
    before = file.stat().st_mtime_ns, file.read_bytes()
    run = CASES[name].run(file, starts)
    assert len(js.resume(file, progress=False)) == len(run)
    assert before == (file.stat().st_mtime_ns, file.read_bytes())


# --- files ----------------------------------------------------------------------------------------


def limited(name, file, starts, most):
    """Run a case in which no file may have more bytes."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    CASES[name].run(file, starts)


@pytest.mark.parametrize("name", quick(DRIVERS, RECORDED))
def test_a_disk_without_room_leaves_the_last_checkpoint(name, whole, starts, tmp_path, patched):
    patched(*SHORT, *NONE)
    file = tmp_path / "run.h5"
    unfinished(name, file, starts)
    before = file.read_bytes()
    args = (name, file, starts, len(before) - 100)
    assert ended(forked(limited, args, tmp_path / "said.log", (*SHORT, *EVERY))) == 1
    assert "cannot be written (File too large), expected a writable folder with room" in said(
        tmp_path
    )
    assert file.read_bytes() == before
    assert names(tmp_path) == ALONE
    CASES[name].run(file, starts)
    require_same(whole(name), file)


def with_progress(name, file, starts, target):
    """Run a case whose standard error is full or closed."""
    if target == "none":  # as Python begins where it is closed
        sys.stderr = None
    elif target == "closed":
        os.close(2)
    else:
        os.dup2(os.open(target, os.O_WRONLY), 2)
    try:
        run_case(name, file, starts, {"progress": True})
    except BaseException as error:  # noqa: BLE001 - that of any kind
        file.with_name("said.log").write_text(repr(error))
        os._exit(1)
    os._exit(0)  # multiprocessing would fail to flush it


@pytest.mark.parametrize(
    ("name", "target"), in_turn([*DRIVERS], ["/dev/full", "closed", "none"], kept=RECORDED)
)
def test_no_run_ends_for_its_standard_error(name, target, whole, starts, tmp_path):
    file = tmp_path / "run.h5"
    args = (name, file, starts, target)
    assert ended(forked(with_progress, args, tmp_path / "said.log", SHORT)) == 0, said(tmp_path)
    require_same(whole(name), file)


@pytest.mark.parametrize("name", quick(DRIVERS, RECORDED))
def test_a_link_and_its_target_are_one_run(name, whole, starts, tmp_path, patched):
    patched(*SHORT, *NONE)
    (tmp_path / "there").mkdir()
    file, link = tmp_path / "there" / "run.h5", tmp_path / "link.h5"
    link.symlink_to(file)
    unfinished(name, link, starts)
    assert names(tmp_path / "there") == {"run.h5"}
    CASES[name].run(file, starts)
    assert link.is_symlink()
    require_same(whole(name), link)


def forgotten(file):
    del file["checkpoint"]


def of_another_version(file):
    file["checkpoint"].attrs["format"] = 999


def without_a_part(file):
    group = file["checkpoint"]
    del group.attrs[next(name for name in group.attrs if name != "format")]


@pytest.mark.parametrize(
    ("name", "damage"), in_turn([*DRIVERS], [forgotten, of_another_version, without_a_part])
)
def test_a_checkpoint_that_cannot_be_used_is_a_sentence(name, damage, starts, tmp_path, patched):
    patched(*SHORT, *NONE)
    file = tmp_path / "run.h5"
    unfinished(name, file, starts)
    with h5py.File(file, "r+") as opened:
        damage(opened)
    before = file.read_bytes()
    for call in (lambda: CASES[name].run(file, starts), lambda: js.resume(file, progress=False)):
        with pytest.raises(
            FileFormatError, match=r"another version .*expected .*checkpoint"
        ) as refused:
            call()
        assert "\n" not in str(refused.value)
    assert file.read_bytes() == before
    assert names(tmp_path) == {"run.h5"}


# --- commands -------------------------------------------------------------------------------------


def jamshape(*words, **how):
    command = [sys.executable, "-m", "jamshape", *map(str, words)]
    return subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **how
    )


def test_a_command_that_stops_in_time_has_an_exit_code_of_its_own(starts, tmp_path):
    start, file = write_start(starts, "dimers"), tmp_path / "run.h5"
    words = ("aqs", "--start", start, "--step", "1e-2", "--strain", 0.05, "--out", file)
    stopped = jamshape(*words, "--seconds", 0)
    _, error = stopped.communicate()
    assert stopped.returncode == 75
    [sentence] = [line for line in error.splitlines() if line.startswith("jamshape aqs: ")]
    assert "stopped after" in sentence
    assert in_process.jamshape(*words).report["strain"] == 0.05
    assert read_attributes(file)["finished"]


def test_ctrl_c_ends_a_command_at_a_checkpoint(starts, tmp_path):
    start, file = write_start(starts, "dimers"), tmp_path / "run.h5"
    words = ("aqs", "--start", start, "--step", "1e-3", "--strain", 1000, "--out", file)
    process = jamshape(*words)
    wait_for(file)
    process.send_signal(signal.SIGINT)
    _, error = process.communicate()
    assert process.returncode == 130
    assert error.endswith(
        "jamshape aqs: interrupted; the same command resumes from the last checkpoint\n"
    )
    assert Content.read(Path(file)).checkpoint
