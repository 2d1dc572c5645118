"""Ensembles: the same rows whoever makes them, failures with their reasons, and tables that go on."""

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.commands.contents import contents_of
from jamshape.files.h5md import FileFormatError, read_attributes
from jamshape.files.origin import origin
from jamshape.protocols.defaults import recipe_for
from jamshape.protocols.ensemble import Means, plan, plan_again

DISCS = js.Spherocylinders(alpha=0)
HOW = {"n": 16, "u0": 1e-8, "seeds": range(3, 11), "progress": False}


def same(one, two):
    """Whether tables agree to the last bit, but for clocks."""
    assert one.observables.keys() == two.observables.keys()
    for name in one.observables.keys() - {"wall_seconds"}:
        assert np.array_equal(one[name], two[name], equal_nan=True), name
    return one.failures == two.failures


@pytest.fixture(scope="module")
def table(tmp_path_factory):
    return js.ensemble(DISCS, **HOW, jobs=2, file=tmp_path_factory.mktemp("set") / "set.h5")


def test_rows_are_those_of_single_packings(table):
    for row in (0, 5):
        alone = js.make_packing(DISCS, n=16, u0=1e-8, seed=3 + row, progress=False)
        for name in ("phi", "phi_J", "u", "pressure", "z", "n_rattlers", "residual", "evaluations"):
            assert table[name][row] == alone.results[name], name
    assert table.seeds.tolist() == list(range(3, 11))
    assert table.reached.all()
    assert set(table.outcome) == {"converged"}
    assert len(table) == 8
    assert table.failures == {}
    assert table.origin == origin()
    assert read_attributes(table.file)["finished"]


@pytest.mark.parametrize("jobs", [1, 3])
def test_rows_do_not_depend_on_the_number_of_workers(table, jobs, tmp_path):
    assert same(table, js.ensemble(DISCS, **HOW, jobs=jobs, file=tmp_path / "set.h5"))
    assert same(table, js.load(tmp_path / "set.h5"))


def test_a_script_needs_no_guard_and_a_kill_loses_nothing(table, tmp_path):
    script = tmp_path / "script.py"
    script.write_text(
        "import jamshape as js\n"
        f"js.ensemble(js.Spherocylinders(alpha=0), n=16, u0=1e-8, seeds=range(3, 11), file={str(tmp_path / 'set.h5')!r},"
        " progress=False)\n"
    )
    rng, code = random.Random(1), None
    for _ in range(20):
        with subprocess.Popen([sys.executable, script]) as going:
            try:
                code = going.wait(rng.uniform(0.5, 3.0))
            except subprocess.TimeoutExpired:
                going.kill()
        if code == 0:
            break
        code = None
    if code is None:
        js.ensemble(DISCS, **HOW, file=tmp_path / "set.h5")
    assert same(table, js.load(tmp_path / "set.h5"))


def test_it_stops_in_time_and_goes_on(table, tmp_path):
    file = tmp_path / "set.h5"
    with pytest.raises(TimeLimitError, match=r"stopped after 0 s at \d of 8, expected the end"):
        js.ensemble(DISCS, **HOW, jobs=1, file=file, seconds=0.0)
    assert not js.load(file).about["finished"]
    copy, folder = tmp_path / "copy.h5", tmp_path / "packings"
    copy.write_bytes(file.read_bytes())
    assert contents_of(copy)["go_on"] == f"js.resume({str(copy)!r}) in Python"
    assert same(table, js.resume(copy, progress=False))
    assert same(table, js.ensemble(DISCS, **HOW, jobs=1, file=file))
    with pytest.raises(TimeLimitError):
        js.ensemble(DISCS, **HOW, jobs=1, file=file, again=True, folder=folder, seconds=0.0)
    assert same(table, js.resume(file, progress=False))
    assert len(list(folder.glob("alpha0_seed*.h5"))) == 8


@pytest.mark.parametrize(
    "particles",
    [
        js.Superellipsoids(p=1.5, w1=0.8, w2=1.0),
        js.Dimers(alpha=0.5, size_ratio=1.2),
        js.Particles.mixture("spherocylinder", [js.Kind({"alpha": 2}, np.float64(1.5), 3), js.Kind()]),
    ],
)  # fmt: skip
def test_a_file_describes_its_particles(particles):
    means = Means.of(1, None, particles, {"u0": 1e-6, "n": np.int64(12), "protocol": "steps"})
    stored = {"arguments": means.arguments, "folder": "", "ensemble_seeds": np.arange(3)}
    first = plan(recipe_for(particles, seed=0, u0=1e-6, n=12, protocol="steps"), range(3), means)
    assert plan_again(stored).settings.keys() == first.settings.keys()
    for name, value in first.settings.items():
        assert np.array_equal(plan_again(stored).settings[name], value), name


def test_one_of_particles_that_it_does_not_describe_needs_its_call(tmp_path):
    many = js.Particles.given("spherocylinder", np.repeat([[1.0], [1.4]], 8, axis=0) * np.ones(3))
    file = tmp_path / "set.h5"
    with pytest.raises(TimeLimitError):
        js.ensemble(many, **HOW | {"seeds": [1, 2]}, file=file, seconds=0.0)
    with pytest.raises(FileFormatError, match=r"is of the kind ensemble, .* repeat the call"):
        js.resume(file)


def test_another_ensemble_in_the_file_is_refused(table):
    for other in ({"n": 17}, {"u0": 1e-7}, {"seeds": range(3, 12)}):
        with pytest.raises(ValueError, match=rf"holds an ensemble with {next(iter(other))}.*again"):
            js.ensemble(DISCS, **HOW | other, file=table.file)


def test_failures_are_rows_with_their_reasons(tmp_path):
    folder = tmp_path / "packings"
    folder.mkdir()
    (folder / "alpha0_seed4.h5").write_text("not HDF5")
    with pytest.warns(js.NotReachedWarning, match=r"1 of 3 samples .* seed 4: .*alpha0_seed4.h5"):
        table = js.ensemble(DISCS, **HOW | {"seeds": [3, 4, 5]}, folder=folder)
    assert table.outcome.tolist() == ["converged", "failed", "converged"]
    assert table.failures.keys() == {4}
    assert np.isnan(table["phi_J"][1])
    assert not table.reached[1]
    kept = js.load(folder / "alpha0_seed5.h5")
    assert kept.results["phi_J"] == table["phi_J"][2]
    with pytest.raises(ValueError, match=r"the sample of seed 4 failed, .*alpha0_seed4.h5"):
        table.packing(1)


def test_a_table_is_no_packing(table, tmp_path):
    file, said = table.file, r"set.h5 holds a table of 8 samples, expected a packing or a run; make"
    for use in (
        lambda: js.energy(file),
        lambda: js.minimise(file, progress=False),
        lambda: js.quasistatic_shear(start=file, progress=False),
        lambda: js.frames(file),
        lambda: js.load(file, 0),
        table.packing,
        lambda: list(table),
        lambda: js.save(tmp_path / "set.gsd", table),
    ):
        with pytest.raises(FileFormatError, match=said):
            use()
    found = contents_of(file)
    assert found["samples"] == 8
    assert not {"phi", "box", "frames"} & found.keys()
    js.save(tmp_path / "copy.h5", table)
    assert same(table, js.load(tmp_path / "copy.h5", dimension=2))


def test_packings_in_a_folder_are_read_by_their_rows(tmp_path):
    file, folder = tmp_path / "set.h5", tmp_path / "packings"
    table = js.ensemble(DISCS, **HOW | {"seeds": [3, 4]}, file=file, folder=folder)
    assert [packing.phi for packing in table] == table["phi"].tolist()
    assert table.packing().results["seed"] == 4
    with pytest.raises(
        FileFormatError, match=r"holds a table of 2 samples.*packings are in .*packings"
    ):
        js.energy(file)


def test_no_worker_outlives_the_process_that_started_it(tmp_path):
    script = (
        "import jamshape as js, sys\n"
        "js.ensemble(js.Spherocylinders(alpha=4), n=400, seeds=range(8), jobs=2, progress=False)\n"
    )
    with subprocess.Popen([sys.executable, "-c", script], cwd=tmp_path) as going:
        workers, deadline = set(), time.monotonic() + 60
        while len(workers) < 2:
            assert time.monotonic() < deadline
            time.sleep(0.05)
            workers = children(going.pid)
        going.send_signal(signal.SIGKILL)
    deadline = time.monotonic() + 10
    while any(Path(f"/proc/{pid}").exists() for pid in workers):
        assert time.monotonic() < deadline
        time.sleep(0.05)


def children(pid):
    """Processes that a process has started."""
    found = set()
    for task in Path(f"/proc/{pid}/task").glob("*/children"):
        found |= {int(word) for word in task.read_text().split()}
    return found


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"seeds": []}, "seeds has 0 numbers"),
        ({"seeds": [1, 1]}, "seeds has 2 numbers, 1 of them different"),
        ({"seeds": [-1]}, "seed is -1"),
        ({"jobs": 0}, "jobs is 0"),
        ({"colour": 1}, "colour is not a setting of a recipe"),
        ({"kappa": 1e-3}, "kappa does not apply to the protocol quasistatic"),
    ],
)
def test_invalid_settings_are_refused_at_once(wrong, said):
    with pytest.raises(ValueError, match=said):
        js.ensemble(DISCS, **HOW | wrong)


def test_it_becomes_a_data_frame(table):
    pandas = pytest.importorskip("pandas")
    frame = table.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame["phi_J"].tolist() == table["phi_J"].tolist()
    assert frame["seed"].tolist() == list(range(3, 11))


def test_its_picture_counts_samples_at_rest(table):
    axes = Figure().add_subplot()
    assert table.plot(axes) is axes
    assert sum(bar.get_height() for bar in axes.patches) == 8
    assert "8 of 8 samples" in axes.get_title()
