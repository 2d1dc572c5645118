"""Bracket of jamming: frames of a compression that stay jammed when minimised."""

import numpy as np
import pytest

import jamshape as js
from jamshape.files.h5md import read_attributes
from jamshape.landscape import Landscape
from jamshape.measures import jamming
from jamshape.measures.jamming import Jamming, Tried, minimised_frames, stays_jammed
from jamshape.measures.onset import OnsetFit
from jamshape.measures.runs import read_run, summary_of
from jamshape.packing import State

NAN = float("nan")


def numbers_at(phi):
    """Frames that are their own number, with a verdict for each packing fraction."""

    class Frame:
        def __init__(self, k):
            self.phi, self.number = phi[k], k

    return Frame


def minimised(monkeypatch, phi, stays):
    """The frames that are minimised, in their order, if these are the verdicts."""
    monkeypatch.setattr(jamming, "stays_jammed", lambda frame, _: stays[frame.number])
    return list(minimised_frames(len(phi), numbers_at(phi)))


@pytest.mark.parametrize("count", [1, 2, 7, 32, 33, 100, 1000])
@pytest.mark.parametrize("part", [0.0, 0.3, 0.6, 0.97, 1.0])
def test_the_change_is_found_between_neighbours(monkeypatch, count, part):
    phi, first = np.linspace(0.8, 0.9, count), int(part * count)
    tried = minimised(monkeypatch, phi, [k >= first for k in range(count)])
    found = Jamming.of(tried)
    assert found.tried == len(tried) == len({one.frame for one in tried})
    assert len(tried) <= 32 + 2 * np.ceil(count / 32)
    assert found.unjams == pytest.approx(phi[first - 1] if first else NAN, nan_ok=True)
    assert found.jams == pytest.approx(phi[first] if first < count else NAN, nan_ok=True)


def test_it_is_the_densest_frame_that_unjams(monkeypatch):
    phi = np.linspace(0.8, 0.9, 11)
    stays = [False, False, True, True, False, None, True, True, None, True, True]
    tried = minimised(monkeypatch, phi, stays)
    assert [one.frame for one in tried] == [10, 9, 8, 7, 6, 5, 4]
    assert Jamming.of(tried) == (phi[4], phi[6], 7, 2)


def test_frames_that_are_undecided_bound_nothing():
    assert str(Jamming.of([Tried(1, 0.9, None), Tried(0, 0.8, None)])) == str(
        Jamming(NAN, NAN, 2, 2)
    )
    assert Jamming.of([Tried(1, 0.9, None), Tried(0, 0.8, False)])[0] == 0.8


FITS = {
    (0.829, 0.003): "onset of flow and not of jamming",
    (0.856, 0.001): "borne out",
    (0.850, 0.006): "borne out",
    (0.864, 0.010): "borne out",
    (0.864, 0.003): "not where jamming begins but later",
}


@pytest.mark.parametrize(("fit", "said"), FITS.items())
def test_the_verdict_is_one_sentence(fit, said):
    found = Jamming(0.855, 0.858, 4).verdict(OnsetFit(*fit, 0.2, 3, 9), 1e-6)
    assert found.startswith("phi_J(kappa = 1e-06) = 0.8")
    assert said in found
    assert found.endswith(
        "the frame at phi = 0.85500 unjams and that at phi = 0.85800 stays jammed."
    )
    assert "\n" not in found


@pytest.mark.parametrize(
    ("known", "said"),
    [
        ((0.8, NAN), "the frame at phi = 0.80000 unjams and no denser one stays jammed."),
        ((NAN, 0.9), "none of the frames unjams, down to phi = 0.90000."),
        ((NAN, NAN), "none of the frames unjams."),
    ],
)
def test_what_is_missing_is_said(known, said):
    fit = OnsetFit(0.85, 0.001, 0.2, 3, 9)
    assert Jamming(*known).verdict(None, 1e-6) == f"p(phi) has no onset; minimised, {said}"
    assert Jamming(*known).verdict(fit, 1e-6).endswith(f"minimised, {said}")


def test_what_is_stored_comes_back():
    found = Jamming(0.85, NAN, 3)
    assert str(Jamming.stored(found.attributes() | {"kappa": 1e-6})) == str(found)
    assert Jamming.stored({"kappa": 1e-6, "phi_jams": 0.8}) is None


@pytest.mark.parametrize("alpha", [0, 4])
def test_a_packing_stays_jammed_and_the_same_one_opened_does_not(alpha, tmp_path):
    rods = js.Spherocylinders(alpha=alpha)
    packing = js.make_packing(rods, n=24, u0=1e-8, file=tmp_path / "p.h5", progress=False)
    phi_J, state = packing.results["phi_J"], State.of(packing)
    assert stays_jammed(packing)
    # A little above phi_J and a little below: the scale of all lengths of the box.
    for factor, stays in ((1.000_05, True), (0.999_95, False)):
        strain = (packing.phi / (factor * phi_J)) ** 0.5 - 1
        assert stays_jammed(state.strained(strain).packing(packing)) is stays


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A slow compression that begins unjammed and ends jammed."""
    folder = tmp_path_factory.mktemp("jamming")
    rods = js.Spherocylinders(alpha=1)
    about = {"n": 24, "seed": 2, "phi": (0.78, 0.93), "kappa": 1e-6, "progress": False}
    return js.slow_compress(rods, **about, file=folder / "run.h5")


@pytest.mark.lammps
def test_frames_of_a_run_bracket_jamming(run):
    found = run.jamming(progress=False)
    assert 0.8 < found.unjams < found.jams < 0.92
    phi = np.array([frame.phi for frame in run])
    k = int(np.flatnonzero(phi == found.unjams)[0])
    assert phi[k + 1] == found.jams
    for frame, stays in ((k, False), (k + 1, True), (len(run) - 1, True)):
        assert stays_jammed(run.packing(frame)) is stays
        landscape = Landscape(run.packing(frame))
        assert landscape.evaluate(State.of(run.packing(frame))).energy > 0  # it flows or is jammed


@pytest.mark.lammps
def test_its_file_keeps_it_and_all_who_report_tell_it(run):
    found = run.jamming(progress=False)
    stored = read_attributes(run.file)
    assert (stored["phi_unjams"], stored["phi_jams"]) == found[:2]
    assert Jamming.stored(run.about) == found
    assert js.load(run.file).jamming(progress=False) == read_run(run.file).jamming == found
    said = summary_of(run.file)
    assert said["onset"] == found.verdict(run.onset(), 1e-6)
    assert said["phi_J(kappa)"] == run.onset().phi_J
    legend = run.plot().get_legend()
    texts = [text.get_text() for text in legend.get_texts()]
    assert any("minimised: " in text and "stays jammed" in text for text in texts)
    assert any(r"\phi_J(\kappa=" in text for text in texts)
