"""A packing without a file: nothing is written, and it is the one that a file would hold."""

import os
import signal
import tempfile

import numpy as np
import pytest

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.protocols.make import made
from jamshape.protocols.recipe import Adaptive, Recipe
from jamshape.recording.recorder import How

QUICK = {"n": 16, "u0": 1e-8, "progress": False}
STEPS = {
    "quasistatic": {},
    "strict": {"strict": True},
    "steps": {"protocol": "steps"},
    "first jammed": {"protocol": "steps", "u0": 0},
    "Monte Carlo": {"protocol": "yuan-2019-2", "n_sweeps": 20, "u0": 0},
}
IN_LAMMPS = {
    "dynamics": {"protocol": "dynamics", "kappa": 1e-5, "phi_start": 0.5},
    "marschall-2018": {"protocol": "marschall-2018", "kappa": 1e-4},
}
RUNS = {
    "wall_seconds",
    "start_file",
}  # the second names the compression in LAMMPS, beside the packing


@pytest.fixture
def nowhere(tmp_path, monkeypatch):
    """The present and the temporary folder, both empty."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def make(how, **place):
    return js.make_packing(js.Spherocylinders(alpha=1), **(QUICK | how | place))


def alike(one, other):
    if isinstance(one, js.Box):
        return all(alike(getattr(one, k), getattr(other, k)) for k in ("lo", "edges", "tilt"))
    if isinstance(one, np.ndarray):
        flags = one.flags.writeable == other.flags.writeable
        return flags and one.dtype == other.dtype and one.tobytes() == other.tobytes()
    return type(one) is type(other) and (one == other or one != one)  # noqa: PLR0124 - NaN


def require_alike(memory, stored):
    assert type(memory) is type(stored) is js.Packing
    for name in set(js.Packing.__dataclass_fields__) - {"results", "file"}:
        assert alike(getattr(memory, name), getattr(stored, name)), name
    assert memory.results.keys() == stored.results.keys()
    for name in memory.results.keys() - RUNS:
        assert alike(memory.results[name], stored.results[name]), name


@pytest.mark.parametrize("how", STEPS.values(), ids=STEPS)
def test_it_is_the_one_of_a_file_and_nothing_is_written(how, nowhere, monkeypatch):
    with monkeypatch.context() as closed:
        closed.setattr("jamshape.files.hdf5.hdf5", None)
        closed.setattr(tempfile, "mkdtemp", None)
        memory = make(how)
    assert not list(nowhere.iterdir())
    require_alike(memory, make(how, file="packing.h5"))
    assert memory.file is None


@pytest.mark.lammps
@pytest.mark.parametrize("how", IN_LAMMPS.values(), ids=IN_LAMMPS)
def test_a_compression_in_lammps_leaves_nothing(how, nowhere):
    memory = make(how)
    assert not list(nowhere.iterdir())
    require_alike(memory, make(how, file="packing.h5"))


def test_in_space_as_well(nowhere):
    how = {"n": 12, "u0": 1e-6, "progress": False, "dimension": 3, "seed": 2}
    for particles in (js.Superellipsoids(p=1, w1=0.8, w2=1.3), js.Dimers(alpha=1)):
        memory = js.make_packing(particles, **how)
        assert not list(nowhere.glob("*"))
        require_alike(memory, js.make_packing(particles, file="packing.h5", **how))
        (nowhere / "packing.h5").unlink()


def test_a_result_can_be_saved_later(nowhere):
    memory = make({})
    js.save("packing.h5", memory)
    require_alike(memory, js.load("packing.h5"))
    assert [one.name for one in nowhere.iterdir()] == ["packing.h5"]


def test_a_time_limit_says_what_would_keep_the_work(nowhere):
    with pytest.raises(TimeLimitError, match=r"^stopped after 0 s at phi .*; with a file the same"):
        make({}, seconds=0.0)
    assert not list(nowhere.iterdir())


@pytest.mark.lammps
def test_a_time_limit_in_lammps_names_no_temporary_file(nowhere):
    said = "^stopped after 0 s in the compression, expected the end; with a file the same call resumes it"
    with pytest.raises(TimeLimitError, match=said):
        make(IN_LAMMPS["dynamics"], seconds=0.0)
    assert not list(nowhere.iterdir())


RECIPE = Recipe(n=16, way=Adaptive())


def test_ctrl_c_ends_it(nowhere, capsys):
    rows = []

    def tell(row):
        rows.append(row)
        os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        made(RECIPE, How(tell=tell))
    assert len(rows) == 2  # it ends where a checkpoint would be
    assert "once more ends at once" in capsys.readouterr().err
    assert not list(nowhere.iterdir())


def test_a_signal_that_somebody_else_takes_ends_it_too():
    sent, taken = [], []

    def tell(row):
        if not sent:
            sent.append(row)
            os.kill(os.getpid(), signal.SIGTERM)

    before = signal.signal(signal.SIGTERM, lambda *_: taken.append(1))
    try:
        with pytest.raises(KeyboardInterrupt):
            made(RECIPE, How(tell=tell))
    finally:
        signal.signal(signal.SIGTERM, before)
    assert taken == [1]
