"""Cyclic shear in LAMMPS, recorded in a file: its strain, energy balance, and displacements from cycle to cycle."""

import json

import numpy as np
import pytest
from in_process import jamshape
from scipy.integrate import simpson
from thinned import in_turn

import jamshape as js
from jamshape.files.content import Content

pytestmark = pytest.mark.lammps

RODS, DISCS = js.Spherocylinders(alpha=1), js.Spherocylinders(alpha=0)
BODIES = js.Superellipsoids(w1=0.6)


def cyclic(particles=None, **how):
    return js.cyclic_shear(particles, **{"rows": 20, "progress": False} | how)


def wave(run):
    """Strains of the rows in closed form."""
    phase = np.arange(len(run.strain)) / run.about["rows"] % 1
    unit = np.where(phase <= 0.25, 4 * phase, np.where(phase <= 0.75, 2 - 4 * phase, 4 * phase - 4))
    return run.about["amplitude"] * unit


@pytest.mark.parametrize(
    ("dimension", "how", "flow"),
    in_turn([2, 3], [{"dt": 0.07}, {"integrator": "rkc2"}], ["simple", "pure"]),
)
def test_the_strain_is_a_triangle_and_the_box_returns_to_the_last_bit(
    dimension, how, flow, tmp_path, measured
):
    particles = {2: RODS, 3: BODIES}[dimension]
    run = cyclic(particles, n=8, dimension=dimension, phi=0.5, amplitude=0.03, period=30, cycles=3, flow=flow,
                 file=tmp_path / "a.h5", **how)  # fmt: skip
    measured(strain=np.abs(run.strain - wave(run)).max())
    np.testing.assert_allclose(run.strain, wave(run), rtol=0, atol=1e-16)
    np.testing.assert_allclose(run.phi, 0.5, rtol=1e-14)
    assert not run.strain[::20].any()
    assert len(run) == 4
    first = run.packing(0).box
    for frame in run:
        np.testing.assert_array_equal(frame.box.lo, first.lo)
        np.testing.assert_array_equal(frame.box.matrix, first.matrix)
        assert frame.time == pytest.approx(30 * run["cycle"][20] * round(frame.time / 30))


@pytest.mark.parametrize("flow", ["simple", "pure"])
def test_a_box_that_takes_other_cell_vectors_returns(flow, tmp_path):
    run = cyclic(
        RODS, n=8, phi=0.6, amplitude=1.3, period=520, cycles=2, flow=flow, file=tmp_path / "a.h5"
    )
    np.testing.assert_allclose(run.strain, wave(run), rtol=0, atol=1e-14)
    np.testing.assert_allclose(run.packing(-1).box.matrix, run.packing(0).box.matrix, atol=1e-13)


@pytest.mark.parametrize(("dimension", "flow"), in_turn([2, 3], ["simple", "pure"]))
def test_particles_without_contacts_return_to_their_places(dimension, flow, tmp_path, measured):
    """The host carries them back; rods turn back by the same equation, to the error of the steps."""
    particles = {2: RODS, 3: BODIES}[dimension]
    run = cyclic(particles, n=4, dimension=dimension, phi=1e-3, amplitude=0.8, period=320, cycles=2, flow=flow,
                 integration_tolerance=1e-9, file=tmp_path / "a.h5")  # fmt: skip
    assert not run["u"].any()
    scale = run.packing(0).box.edges.max()
    measured(displacement=np.sqrt(run["displacement"].max()) / scale)
    assert np.sqrt(run["displacement"].max()) < 1e-13 * scale
    first, last = run.packing(0), run.packing(-1)
    np.testing.assert_allclose(
        np.abs((first.body_axes(0) * last.body_axes(0)).sum(axis=1)), 1, atol=1e-12
    )
    assert np.abs(run["turned"][-1]) < 1e-6
    assert np.abs(run["turned"]).max() > (0.1 if flow == "simple" and dimension == 2 else -1)


def pair():
    """Two discs that overlap."""
    return js.Packing(
        position=np.array([[4.0, 5.0], [4.9, 5.1]]), orientation=np.zeros(2), diameters=np.ones((2, 3)),
        species=np.ones(2, int), id=np.arange(1, 3), box=js.Box(lo=[0, 0], edges=[10, 10]),
    )  # fmt: skip


def test_a_pair_is_pushed_apart_once_and_then_returns(tmp_path):
    run = cyclic(start=pair(), amplitude=0.1, period=400, cycles=6, dt=0.1, file=tmp_path / "a.h5")
    assert run.displacement[0] > 1e-3
    assert run.displacement[-1] < 1e-7 * run.displacement[0]
    assert run.dissipated[-1] < 1e-6 * run.dissipated[0]


@pytest.mark.parametrize(
    ("flow", "how"), in_turn(["simple", "pure"], [{"dt": 1 / 16}, {"integrator": "rkc2"}])
)
def test_a_quarter_is_a_shear_to_the_last_bit(flow, how, tmp_path):
    """Rate and steps are powers of two, and both runs have the same marks."""
    begin = {"n": 16, "phi": 0.85, "flow": flow} | how
    run = cyclic(
        RODS, amplitude=1 / 16, period=256, cycles=1, rows=64, file=tmp_path / "a.h5", **begin
    )
    shear = js.shear(
        RODS, gdot=run.gdot, strain=1 / 16, rows=16, file=tmp_path / "b.h5", progress=False, **begin
    )
    assert shear.about["dt"] == run.about["dt"]
    assert shear["evaluations"][-1] > 100
    for name, values in shear.observables.items():
        np.testing.assert_array_equal(run[name][:17], values, err_msg=name)


@pytest.mark.parametrize(("dimension", "flow"), in_turn([2, 3], ["simple", "pure"]))
def test_work_is_stored_or_dissipated(dimension, flow, tmp_path, measured):
    """dU/dt = stress * rate - torques on the rotation of the host - dissipation, quarter by quarter."""
    particles, phi = {2: (RODS, 0.86), 3: (BODIES, 0.7)}[dimension]
    run = cyclic(particles, n=16, dimension=dimension, phi=phi, amplitude=0.02, period=80, cycles=1, flow=flow, rows=400,
                 dt=0.05, file=tmp_path / "a.h5")  # fmt: skip
    work = spin = lost = 0.0
    for k in range(4):
        rows, sign = slice(100 * k, 100 * k + 101), 1 if k % 4 in {0, 3} else -1
        torque = run["torque_power"][rows].copy()
        torque[0] *= -1 if k % 2 else 1  # that of the row was at the rate before
        work += sign * run.gdot * simpson(run.stress[rows], dx=0.2)
        spin += simpson(torque, dx=0.2)
        lost += simpson(run["dissipation"][rows], dx=0.2)
    stored = run["u"][-1] - run["u"][0]
    measured(balance=abs(stored - work + spin + lost) / lost)
    assert stored == pytest.approx(work - spin - lost, abs=2e-4 * lost)
    assert run.dissipated.sum() == pytest.approx(lost, rel=2e-3)


def test_small_strains_become_reversible_and_large_ones_do_not(tmp_path, measured):
    small = cyclic(
        DISCS, n=32, phi=0.78, amplitude=0.01, period=100, cycles=12, file=tmp_path / "a.h5"
    )
    large = cyclic(
        DISCS, n=32, phi=0.83, amplitude=0.6, period=1500, cycles=3, file=tmp_path / "b.h5"
    )
    measured(small=small.displacement[-1] / small.displacement[0], large=large.displacement[-1])
    assert small.displacement[-1] < 1e-2 * small.displacement[0]
    assert (np.diff(small.displacement) < 0).all()
    assert large.displacement[2:].min() > 10 * small.displacement[0]
    for run in (small, large):
        places = np.array([frame.position + frame.image @ frame.box.matrix.T for frame in run])
        moved = (np.diff(places, axis=0) ** 2).sum(axis=2).mean(axis=1)
        np.testing.assert_allclose(run.displacement, moved, rtol=1e-9, atol=1e-26)


def test_frames_are_of_ends_of_cycles(tmp_path):
    run = cyclic(
        DISCS, n=8, phi=0.7, period=40, amplitude=0.02, cycles=7, frames=3, file=tmp_path / "a.h5"
    )
    assert [round(frame.time / 40, 9) for frame in run] == [0, 2, 4, 6, 7]


@pytest.mark.parametrize(
    ("name", "value", "sentence"),
    [
        (
            "rows",
            6,
            "rows is 6 in a cycle of 800 steps, expected a multiple of 4 that divides them",
        ),
        ("dt", 0.03, "dt = 0.03 divides a quarter of the period into 333.333 steps"),
        ("period", np.nan, "period is nan, expected a positive number"),
        ("cycles", 0, "cycles is 0, expected"),
    ],
)
def test_settings_that_cannot_be_of_a_file_are_refused(name, value, sentence, tmp_path):
    run = cyclic(
        DISCS, n=8, phi=0.5, period=40, amplitude=0.02, cycles=1, dt=0.05, file=tmp_path / "a.h5"
    )
    content = Content.read(run.file)
    content.attributes |= {name: value, "finished": False}
    content.write()
    with pytest.raises(ValueError, match=sentence):
        js.resume(run.file, progress=False)


def test_it_is_loaded_resumed_shown_and_described_as_what_it_is(tmp_path):
    file = tmp_path / "a.h5"
    words = ("cycle", "--alpha", 0, "--n", 12, "--phi", 0.7, "--amplitude", 0.02, "--period", 40, "--cycles", 2,
             "--rows", 8, "--out", file)  # fmt: skip
    said = jamshape(*words).out
    told = json.loads(said.splitlines()[-1])
    assert told["displacement"] > 0
    assert [cycle["number"] for cycle in told["per_cycle"]] == [1, 2]
    assert jamshape(*words).out == said
    run = js.load(file)
    assert isinstance(run, js.CyclicShearFile)
    assert js.resume(file, progress=False).gdot == 0.002
    axes = run.plot()
    assert "cyclic shear" in axes.get_title()
    assert [line.get_label() for line in axes.lines][1:] == ["cycle 1", "cycle 2"]
    said = jamshape("info", file).out
    assert "a.h5: cyclic shear" in said
    assert "simple shear to strains of +-0.02, 2 cycles of the period 40" in said
    last = run.cycles()[-1]
    assert f"number 2, work {last.work:.4g}, lost {last.lost:.4g}, storage modulus" in said
    assert json.loads(said.splitlines()[-1])["last_cycle"] == last._asdict()
    assert f"$G''={last.loss:.3g}$" in axes.get_title()


def test_a_rate_that_contacts_do_not_bear_is_told_before_the_run(tmp_path):
    with pytest.warns(UserWarning, match="so that long ones may cross"):
        cyclic(
            js.Spherocylinders(alpha=4),
            n=2,
            phi=0.3,
            amplitude=0.02,
            period=0.8,
            cycles=1,
            file=tmp_path / "a.h5",
        )
