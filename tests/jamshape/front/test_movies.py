"""Movies: their frames, what is drawn in each, and what is refused."""

from __future__ import annotations

import json
import shutil
import subprocess
import warnings

import numpy as np
import pytest
from PIL import Image

import jamshape as js
from jamshape.commands import main
from jamshape.drawing.movie import Movie
from jamshape.files.hdf5 import FileFormatError
from jamshape.protocols.random_start import random_packing


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("movies")


@pytest.fixture(scope="module")
def packing(folder):
    rods = js.Spherocylinders(alpha=4)
    return js.make_packing(rods, n=16, u0=1e-6, file=folder / "packing.h5", progress=False)


@pytest.fixture(scope="module")
def run(packing, folder):
    return js.quasistatic_shear(
        start=packing, step=0.05, strain=0.4, frames=8, file=folder / "aqs.h5", progress=False
    )


def pixels(movie, frame):
    figure = movie.draw(frame)
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415

    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba()).astype(int)


def collections(movie, frame):
    (axes,) = movie.draw(frame).axes
    return axes, axes.collections, axes.lines


def test_a_run_has_a_frame_for_each_of_its_own(run, tmp_path):
    js.animate(run, tmp_path / "run.gif", fps=5, dpi=40)
    with Image.open(tmp_path / "run.gif") as image:
        assert image.n_frames in {len(run), len(run) - 1}  # the start may equal its minimum
        durations = []
        for k in range(image.n_frames):
            image.seek(k)
            durations.append(image.info["duration"])
    assert sum(durations) == pytest.approx(200 * len(run), rel=0.05)
    js.animate(run, tmp_path / "few.gif", every=4, dpi=40)
    with Image.open(tmp_path / "few.gif") as image:
        assert image.n_frames == 3


def test_the_view_stays_and_the_box_tilts(run):
    movie = js.animate(run)
    assert isinstance(movie, Movie)
    limits = set()
    for k in (0, len(run) - 1):
        axes, (bodies, spines, points), (box,) = collections(movie, k)
        shown = run.packing(k)
        limits.add((axes.get_xlim(), axes.get_ylim()))
        assert len(bodies.get_paths()) == len(spines.get_segments()) == shown.n
        assert len(points.get_paths()) == len(shown.contacts().network.bonds.point)
        corner = np.array(box.get_xydata()[2])
        np.testing.assert_allclose(corner, shown.box.lo + shown.box.vectors(np.ones(2)))
    assert len(limits) == 1
    assert "strain $\\gamma=0.4000$" in axes.get_title()
    ((low, high), _) = limits.pop()
    for k in range(len(run)):
        _, (bodies, *_), _ = collections(movie, k)
        x = np.concatenate([path.vertices[:, 0] for path in bodies.get_paths()])
        assert low <= x.min()
        assert x.max() <= high
    assert abs(pixels(movie, 0) - pixels(movie, 8)).max() > 100


def test_points_of_contact_lie_in_the_particles_that_are_drawn(run):
    _, (bodies, _, points), _ = collections(js.animate(run), 1)
    outlines = bodies.get_paths()
    for dot in points.get_paths():
        center = dot.vertices[:-1].mean(axis=0)
        assert any(one.contains_point(center, radius=0.1) for one in outlines)


@pytest.mark.parametrize("mode", [2, -1])
def test_particles_swing_along_a_mode(packing, mode):
    modes = js.modes(packing)
    movie = js.animate(modes, mode, amplitude=0.25)
    places = []
    for k in range(len(movie)):
        shot = movie._shots[k]
        places.append(shot.centers)
        _, (bodies, _, points), _ = collections(movie, k)
        assert len(bodies.get_paths()) == packing.n
        assert not len(points.get_paths())
    shift, turn = modes.table.coordinates.motion(modes.vectors[:, mode])
    along = np.array(places) - places[0]
    np.testing.assert_allclose(along[6], -along[18], atol=1e-12)
    np.testing.assert_allclose(along[12], 0, atol=1e-12)
    scale = (along[6] * shift).sum() / (shift**2).sum()
    np.testing.assert_allclose(along[6], scale * shift, atol=1e-12)
    reach = np.sqrt((shift**2).sum(axis=1)) + np.abs(turn[:, 0]) * packing.outer_radius
    assert scale * reach.max() == pytest.approx(0.25 * packing.inner_radius.min())
    turned = movie._shots[6].found.packing.orientation - packing.orientation
    np.testing.assert_allclose(np.sin(turned), np.sin(scale * turn[:, 0]), atol=1e-12)


def test_packings_in_space_and_in_a_row(folder, tmp_path):
    bodies = js.Superellipsoids(w1=0.6)
    start = js.make_packing(bodies, n=8, dimension=3, u0=1e-6, file=folder / "b.h5", progress=False)
    run = js.quasistatic_shear(start=start, step=0.02, strain=0.04, frames=2, progress=False)
    movie = js.animate(list(run))
    assert len(movie) == len(run)
    assert abs(pixels(movie, 1) - pixels(movie, 3)).max() > 100
    js.animate((one for one in run), tmp_path / "row.gif", color="orientation")
    assert (tmp_path / "row.gif").exists()


def test_notebooks_show_a_player_and_orders_have_one_scale(run):
    movie = js.animate(run, every=8, color="S2")
    assert movie._repr_html_().count("data:image/png") == 2
    assert len(movie.draw(0).axes) == 2


def test_modes_of_a_file_swing_as_those_in_memory(packing, tmp_path):
    modes = js.modes(packing)
    modes.save(tmp_path / "modes.h5")
    read = js.load(tmp_path / "modes.h5")
    assert read.packing.u == packing.u  # to the last bit, with its law
    assert read.packing.results["u0"] == packing.results["u0"]
    own, again = (js.animate(one, 9, amplitude=1.0) for one in (modes, read))
    assert (pixels(own, 5) == pixels(again, 5)).all()
    read.save(tmp_path / "copy.h5")
    assert js.load(tmp_path / "copy.h5").packing.u == packing.u
    with pytest.raises(FileFormatError, match="holds modes"):
        js.minimise(tmp_path / "modes.h5")


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="there is no ffmpeg")
@pytest.mark.parametrize("suffix", [".mp4", ".mkv"])
def test_ffmpeg_writes_the_frames_that_are_drawn(run, suffix, tmp_path):
    file, still = tmp_path / f"run{suffix}", tmp_path / "%d.png"
    js.animate(run, file, fps=4, every=4, dpi=60)
    subprocess.run(["ffmpeg", "-v", "error", "-i", file, still], check=True)
    movie = js.animate(run, every=4, dpi=60)
    assert len(list(tmp_path.glob("*.png"))) == len(movie) == 3
    for k in range(3):
        found = np.asarray(Image.open(tmp_path / f"{k + 1}.png").convert("RGB")).astype(int)
        drawn = pixels(movie, k)[: found.shape[0], : found.shape[1], :3]
        assert found.shape == drawn.shape  # even, or one pixel less
        assert abs(found - drawn).mean() < 4  # of 255; other frames differ by more
        assert (
            abs(found - pixels(movie, (k + 1) % 3)[: found.shape[0], : found.shape[1], :3]).mean()
            > 8
        )


def test_what_is_wrong_is_said(run, packing, tmp_path, monkeypatch):
    from matplotlib import animation  # noqa: PLC0415

    monkeypatch.setattr(animation.writers, "is_available", lambda _: False)
    modes = js.modes(packing)
    modes.save(tmp_path / "modes.h5", vectors=False)
    for call, words in (
        (lambda: js.animate(run, "x.mp4"), "needs ffmpeg, which is not installed; .* ends in .gif"),
        (lambda: js.animate(run, "x.png"), "has the suffix '.png', expected one of .gif"),
        (lambda: js.animate(run, 3), "mode=3 has no effect on a QuasistaticShearFile"),
        (lambda: js.animate(run, amplitude=1.0), "amplitude=1.0 has no effect"),
        (lambda: js.animate(run, every=0), "every is 0, expected a whole number of frames"),
        (lambda: js.animate(run, fps=0), "fps is 0, expected"),
        (lambda: js.animate(run, color="S9"), "color is 'S9'|expected one of kind"),
        (lambda: js.animate(modes), "mode is missing, expected the number of a mode"),
        (
            lambda: js.animate(modes, 48),
            "mode is 48, expected a whole number of a mode from -48 to 47|expected",
        ),
        (lambda: js.animate(modes, 4, every=2), "every=2 has no effect with mode=4"),
        (
            lambda: js.animate(js.load(tmp_path / "modes.h5"), 4),
            "modes.h5 holds no packing with its",
        ),
        (lambda: js.animate([]), "no packings were given"),
        (lambda: js.animate([1, 2]), "expected a packing in each frame"),
        (
            lambda: js.animate([packing, random_packing(8, 0.1, 1, dimension=3)]),
            "thing has packings in 2D and in 3D, expected one dimension; make a movie of each",
        ),
        (lambda: js.animate(3), "expected a run, modes or packings in a row"),
    ):
        with pytest.raises((ValueError, TypeError), match=words):
            call()
    assert not list(tmp_path.glob("x.*"))


def test_a_path_is_opened(run, tmp_path):
    js.save(tmp_path / "aqs.dump", run)
    with pytest.raises(FileNotFoundError):
        js.animate(tmp_path / "none.dump")
    for path in (run.file, str(tmp_path / "aqs.dump")):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the shape of a dump
            movie = js.animate(path)
        assert len(movie) == len(run)


def test_the_command_makes_a_movie(run, packing, tmp_path, monkeypatch, capsys):
    def draw(*words):
        with pytest.raises(SystemExit) as end:
            main(["draw", *map(str, words)])
        return capsys.readouterr().out.splitlines()[-1:], end.value.code

    monkeypatch.chdir(tmp_path)
    js.modes(packing).save("modes.h5")
    done = draw(run.file, "--out", "run.gif", "--every", 4, "--dpi", 40)
    assert done == (['{"out": "run.gif", "frames": 3}'], None)
    (said,), _ = draw("modes.h5", "--mode", 9, "--amplitude", 1, "--out", "mode.gif", "--dpi", 50)
    assert json.loads(said)["omega"] == js.load("modes.h5").omega[9]
    for name, frames in (("run", 3), ("mode", 24)):
        with Image.open(f"{name}.gif") as image:
            assert image.n_frames == frames
    for words, text in (
        ((run.file, "--out", "a.gif", "--frame", 2), "--frame 2 has no effect on a movie"),
        ((run.file, "--out", "a.png", "--fps", 2), "--fps 2.0 has no effect on a picture"),
        ((run.file, "--out", "a.gif", "--mode", 2), "--mode 2 has no effect on a QuasistaticS"),
        (("modes.h5", "--out", "a.gif"), "--mode is missing, expected the number of a mode"),
        (
            ("modes.h5", "--out", "a.png"),
            "holds modes, expected particles; draw a mode with --mode",
        ),
    ):
        assert text in draw(*words)[1]
