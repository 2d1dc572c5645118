"""The law of contacts belongs to a packing, whatever becomes of it."""

import numpy as np
import pytest
from scenes import make

import jamshape as js
from common.spines import with_spines
from jamshape.contacts import Contacts, find_contacts, forces
from jamshape.exchange.gsd import read_gsd, write_gsd
from jamshape.files.h5md import read_packing, write_run
from jamshape.front.packing import public
from jamshape.landscape import Landscape, State

LAW = js.Interaction(k_e=2.5, sides=1)


@pytest.fixture(scope="module")
def rods():
    """Rods side to side, and one that lies across."""
    places = [[5, 5], [5.4, 5.8], [5.1, 6.6], [7.6, 6.2], [8.5, 6.4]]
    packing = make(places, [0, 0, 0, 1.2, 1.2], law=LAW)
    one, two = (forces(packing, 1.0, sides).pressure for sides in (1, 2))
    assert one != pytest.approx(two, rel=1e-3)
    return packing


def test_energy_and_forces_are_those_of_the_law(rods):
    expected = forces(rods, 2.5, 1)
    assert forces(rods).energy == expected.energy
    assert find_contacts(rods).energy.sum() == expected.energy
    assert Contacts.of(rods).energy.sum() == expected.energy
    landscape = Landscape(rods)
    assert (landscape.k_e, landscape.sides) == LAW[:2]
    assert landscape.evaluate(State.of(rods)).energy == pytest.approx(expected.energy, rel=1e-12)
    measured = public(rods)
    assert measured.pressure == expected.pressure
    assert measured.u * rods.box.volume == pytest.approx(expected.energy, rel=1e-14)
    assert Landscape(rods, sides=2).evaluate(State.of(rods)).energy == pytest.approx(
        forces(rods, 2.5, 2).energy, rel=1e-12
    )


def test_copies_carry_it(rods):
    copies = [
        rods.sorted_by_id(),
        rods.with_(time=1.0),
        rods.with_(position=rods.position + 0.5),
        State.of(rods).strained(1e-3).packing(rods),
        rods.with_poses(*rods.poses()),
        public(rods).with_(step=3),
    ]
    assert {copy.law for copy in copies} == {LAW}
    discs = js.Packing(
        position=[[1, 1]], orientation=[0], diameters=[[1, 1, 1]], species=[1], id=[1],
        box=js.Box(lo=[0, 0], edges=[5, 5]), law=LAW,
    )  # fmt: skip
    assert with_spines(discs, 1.0, 1).law == LAW


@pytest.mark.parametrize("end", ["h5", "gsd", "data"])
def test_files_carry_it(rods, tmp_path, end):
    if end == "gsd":
        pytest.importorskip("gsd")
    js.save(tmp_path / f"rods.{end}", rods)
    found = js.load(tmp_path / f"rods.{end}")
    assert found.law == LAW
    assert found.pressure == pytest.approx(forces(rods, 2.5, 1).pressure, rel=1e-12)


def test_frames_of_a_file_have_one_law(rods, tmp_path):
    write_run(tmp_path / "run.h5", [rods, rods.with_(step=rods.step + 1)])
    assert read_packing(tmp_path / "run.h5", 0).law == LAW
    with pytest.raises(ValueError, match="law differs from the first frame"):
        write_run(tmp_path / "run.h5", [rods, rods.with_(step=rods.step + 1, law=js.Interaction())])
    pytest.importorskip("gsd")
    write_gsd(tmp_path / "run.gsd", [rods, rods.with_(law=js.Interaction())])
    assert [read_gsd(tmp_path / "run.gsd", k).law for k in (0, 1)] == [LAW, js.Interaction()]


@pytest.mark.parametrize("law", [(0, 2), (1, 3), (np.nan, 2), ("one", 2), (1,), None, (1, 1.5)])
def test_what_is_no_law_is_refused(rods, law):
    with pytest.raises(ValueError, match=r"law is .*, expected Interaction\(k_e, sides, power\)"):
        rods.with_(law=law)


@pytest.mark.lammps
def test_a_run_with_one_bond_side_to_side(tmp_path):
    """Brute force and LAMMPS's own row agree on these numbers."""
    run = js.compress(
        js.Spherocylinders(alpha=4), n=16, phi=(0.4, 0.95), kappa=1e-3, sides=1, rows=50, frames=5,
        progress=False,
    )  # fmt: skip
    frame = run.packing()
    assert frame.law == js.Interaction(1.0, 1)
    copies = [frame, frame.sorted_by_id(), frame.with_(position=frame.position + 0.5)]
    for end in ("h5", "gsd", "data"):
        js.save(tmp_path / f"frame.{end}", frame)
        copies.append(js.load(tmp_path / f"frame.{end}"))
    for copy in copies:
        assert copy.pressure == pytest.approx(run.pressure[-1], rel=1e-10)
        assert copy.u == pytest.approx(run["u"][-1], rel=1e-10)
        assert copy.z == 5.125
    assert (run.pressure[-1], run["u"][-1]) == pytest.approx((0.0389775, 0.00412858), rel=1e-5)
    laws = [frame.law, js.Interaction(2.5, 1), js.Interaction(1.0, 2)]
    one, stiff, two = (js.modes(frame.with_(law=law), force=True).eigenvalues[-1] for law in laws)
    assert stiff == pytest.approx(2.5 * one, rel=1e-9)
    assert two != pytest.approx(one, rel=1e-3)
    with pytest.warns(UserWarning, match="the start has sides=1.* and the run sides=2: energy"):
        sheared = js.quasistatic_shear(start=frame, step=1e-3, strain=2e-3, progress=False)
    assert sheared.packing(0).law == js.Interaction(1.0, 2)
