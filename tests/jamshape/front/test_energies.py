"""`js.energy` of files, minima and states without a minimum, and modes under the law of the packing."""

import json
import pickle

import numpy as np
import pytest

import jamshape as js
from jamshape.commands import main
from jamshape.contacts import forces
from jamshape.packing import State
from jamshape.protocols.random_start import random_packing
from jamshape.vibration.hessian import NotAtMinimumError

WANTED = {"hessian": True, "compatibility": True}
SOFT = js.Interaction(k_e=2.5, sides=1)


@pytest.fixture(scope="module")
def packing():
    return js.make_packing(js.Spherocylinders(alpha=2), n=16, seed=1, u0=1e-8, progress=False)


@pytest.fixture(scope="module")
def moved(packing):
    return packing.with_(position=packing.position + 1e-4 * np.sin(np.arange(32).reshape(16, 2)))


def test_a_file_has_the_energy_of_its_packing_under_its_own_law(packing, tmp_path):
    own = packing.with_(law=SOFT)
    for end in ("h5", "data"):
        js.save(tmp_path / f"rods.{end}", own)
        for path in (tmp_path / f"rods.{end}", str(tmp_path / f"rods.{end}")):
            found = js.energy(path)
            assert pytest.approx(forces(packing, SOFT.k_e, SOFT.sides).energy, rel=1e-12) == found.U
            assert pytest.approx(forces(packing).energy, rel=1e-3) != found.U
    js.modes(packing).save(tmp_path / "modes.h5")
    with pytest.raises(ValueError, match=r"modes.h5 holds modes, expected particles"):
        js.energy(tmp_path / "modes.h5")
    with pytest.raises(ValueError, match="rotation is 'degree', expected"):
        js.energy(packing, rotation="degree")


def test_a_run_stands_for_its_last_packing(packing):
    run = js.ladder(packing, u0=[1e-7], progress=False)
    assert js.energy(run).U == js.energy(run.packing()).U != js.energy(packing).U
    assert js.modes(run).omega.tolist() == js.modes(run.packing()).omega.tolist()
    assert js.minimise(run, progress=False).u == pytest.approx(1e-7, rel=1e-6)
    assert js.ladder(run, u0=[1e-6], progress=False).values[0] == pytest.approx(1e-7, rel=1e-6)
    assert np.all(js.nonaffine(run, run.packing()).displacement == 0)


def test_the_energy_agrees_with_the_packing(packing):
    e = js.energy(packing)
    assert e.pressure == pytest.approx(packing.pressure, rel=1e-12)
    assert e.u == pytest.approx(packing.u, rel=1e-12)
    assert e.contacts is packing.contacts()
    assert e.hessian is None
    assert e.compatibility is None
    with pytest.raises(AttributeError):
        e.U = 0.0
    again = pickle.loads(pickle.dumps(js.energy(packing, hessian=True)))
    v = np.arange(again.coordinates.size)
    np.testing.assert_allclose(again.hessian @ v, e.hessian_product @ v, rtol=0, atol=1e-11)


def test_the_forces_of_a_minimum_are_its_only_state_of_self_stress():
    """A jammed packing of discs is isostatic: one bond more than degrees of freedom."""
    discs = js.make_packing(js.Spherocylinders(alpha=0), n=32, seed=2, u0=1e-12, progress=False)
    bonds = js.energy(discs, compatibility=True).compatibility
    free = 2 * (~discs.rattlers).sum() - 2
    assert bonds.constraints.n_self_stress == len(bonds.force) - free == 1
    assert bonds.constraints.rank == free
    left, sigma, _ = np.linalg.svd(bonds.matrix.toarray())
    assert sigma[free] < 1e-6 < sigma[free - 1]
    unit = bonds.force / np.linalg.norm(bonds.force)
    assert abs(left[:, free:].T @ unit)[0] == pytest.approx(1, abs=1e-6)


def test_pivots_count_the_rank_of_a_minimum_too(monkeypatch, packing):
    discs = js.make_packing(js.Spherocylinders(alpha=0), n=32, seed=2, u0=1e-6, progress=False)
    for one in (packing, discs):
        exact = js.energy(one, compatibility=True).compatibility.constraints
        with monkeypatch.context() as patch:
            patch.setattr("jamshape.vibration.statistics._DENSE", 2)
            found = js.energy(one, compatibility=True).compatibility.constraints
        assert (exact.method, found.method) == ("svd", "pivots")
        assert found[:4] == exact[:4]
        assert found.n_self_stress >= 1


def test_particles_without_contacts_have_no_energy():
    loose = random_packing(6, 0.1, 1, js.Dimers(), 3)
    e = js.energy(loose, hessian=True, compatibility=True)
    assert (e.U, e.pressure, e.net_force, len(e.contacts)) == (0.0, 0.0, 0.0, 0)
    assert e.hessian.shape == (36, 36)
    assert e.hessian.nnz == 0
    assert not (e.hessian_product @ np.ones(36)).any()
    assert e.compatibility.constraints[:4] == (0, 0, 0, 36)


# --- modes ---------------------------------------------------------------------------------------


def test_modes_and_moduli_follow_the_law_of_the_packing(packing):
    one, stiff = packing.modes(), packing.with_(law=js.Interaction(2.5)).modes()
    np.testing.assert_allclose(stiff.eigenvalues[2:], 2.5 * one.eigenvalues[2:], rtol=1e-9)
    for name in ("bulk", "simple_shear"):
        of_one, of_stiff = (getattr(m.moduli, name).relaxed for m in (one, stiff))
        assert of_stiff == pytest.approx(2.5 * of_one, rel=1e-9)
    flat = packing.contacts().network.n_bonds > 1
    assert flat.any()
    single = packing.with_(law=SOFT)
    found = js.modes(single, force=True)
    e = js.energy(single, rotation="half_length", hessian=True)
    held = ~single.rattlers[e.coordinates.particle]
    expected = e.hessian[held][:, held]
    assert abs(found.matrix.matrix - expected).max() <= 1e-12 * abs(expected).max()
    assert found.matrix.n_bonds < one.matrix.n_bonds


def test_modes_of_a_state_that_is_no_minimum_say_its_net_forces(packing, moved, tmp_path, capsys):
    with pytest.raises(NotAtMinimumError, match="minimise it first"):
        js.modes(moved)
    found = js.modes(moved, force=True)
    residual = found.table.attributes["residual"]
    assert residual > 1e-4
    said = f"not at a minimum: net forces up to {residual:.2g} of the mean bond force"
    assert said in repr(found)
    assert "minimum" not in repr(js.modes(packing))
    js.save(tmp_path / "moved.h5", moved)
    out = tmp_path / "modes.h5"
    with pytest.raises(SystemExit) as ended:
        main(["modes", str(tmp_path / "moved.h5"), "--force", "--out", str(out)])
    assert not ended.value.code
    printed = capsys.readouterr().out
    assert said in printed
    told = json.loads(printed.splitlines()[-1])
    assert (told["at_minimum"], told["residual"]) == (False, residual)
    assert "a saddle" not in printed
    assert said in repr(js.load(out))


def test_modes_of_a_state_that_is_no_minimum_are_those_of_its_hessian(moved):
    found = js.modes(moved, force=True)
    names = ("position", "orientation", "diameters", "exponent", "species", "id", "image")
    held = {name: getattr(moved, name)[~moved.rattlers] for name in names}
    e = js.energy(js.Packing(**held, box=moved.box), rotation="half_length", **WANTED)
    expected = np.linalg.eigvalsh(e.hessian.toarray())
    np.testing.assert_allclose(found.eigenvalues, expected, rtol=0, atol=1e-12 * expected.max())
    told, known = found.table.attributes, e.compatibility.constraints
    assert (told["n_bonds"], told["rank"], told["n_self_stress"]) == known[:3]
    assert known.n_self_stress == 0 < known.rank


# --- non-affine displacements --------------------------------------------------------------------


def sheared(packing, gradient):
    return State.of(packing).deformed(np.asarray(gradient, np.longdouble)).packing(packing)


@pytest.mark.parametrize("dimension", [2, 3])
def test_an_affine_motion_has_no_d2_min(dimension):
    first = random_packing(60, 0.3 if dimension == 2 else 0.15, 1, js.Dimers(), dimension)
    gradient = (
        np.eye(dimension) + np.triu(np.arange(1.0, 10).reshape(3, 3)[:dimension, :dimension]) / 50
    )
    second = sheared(first, gradient)
    # The same lattice with other cell vectors, and every particle somewhere else in it.
    cell, lo = second.box.matrix.copy(), np.arange(dimension) - 0.7
    cell[0, 1] -= cell[0, 0]
    box = js.Box.of(lo, cell)
    inside, turns = box.wrapped(second.position + lo)
    order = np.random.default_rng(1).permutation(first.n)
    names = ("orientation", "diameters", "exponent", "species", "id")
    wrapped = second.with_(
        position=(inside + lo)[order], box=box,
        **{name: getattr(second, name)[order] for name in names},
    )  # fmt: skip
    with_images = wrapped.with_(image=turns[order])
    for now in (second, wrapped, with_images):
        found = js.nonaffine(first, now)
        size = first.box.edges.max() ** 2
        assert np.abs(found.D2_min).max() <= 1e-26 * size * found.n_neighbours.max()
        assert np.abs(found.displacement).max() <= 1e-13 * first.box.edges.max()
        np.testing.assert_allclose(found.box_map, gradient, rtol=0, atol=1e-13)
        np.testing.assert_allclose(
            found.local_map, np.broadcast_to(gradient, found.local_map.shape), rtol=0, atol=1e-12
        )
        assert found.n_neighbours.min() >= dimension


def test_d2_min_is_the_least_square_over_neighbours_by_hand():
    first = random_packing(40, 0.3, 3, js.Spherocylinders(alpha=1), 2)
    rng, cutoff = np.random.default_rng(2), 3.0
    second = first.with_(position=first.position + 0.1 * rng.normal(size=(40, 2)))
    found = js.nonaffine(first, second, neighbours=cutoff)
    np.testing.assert_allclose(
        found.displacement, second.position - first.position, rtol=0, atol=1e-13
    )
    L = first.box.edges
    assert cutoff < L.min() / 2
    for i in range(first.n):
        r, s = ((p.position - p.position[i]) for p in (first, second))
        turns = np.rint(r / L)
        r, s = r - turns * L, s - turns * L
        near = (np.linalg.norm(r, axis=1) < cutoff) & (np.arange(first.n) != i)
        assert near.sum() == found.n_neighbours[i]
        if near.sum() >= 2:
            fit = np.linalg.lstsq(r[near], s[near], rcond=None)[0]
            expected = ((s[near] - r[near] @ fit) ** 2).sum()
            assert found.D2_min[i] == pytest.approx(expected, rel=1e-9, abs=1e-12)
            np.testing.assert_allclose(found.local_map[i], fit.T, rtol=0, atol=1e-9)


def test_image_counts_carry_displacements_beyond_half_a_box():
    first = random_packing(20, 0.3, 3, js.Spherocylinders(alpha=0), 2)
    image = np.zeros((20, 2), np.int64)
    image[4] = [1, -1]
    found = js.nonaffine(first, first.with_(image=image))
    np.testing.assert_allclose(found.displacement[4], [1, -1] * first.box.edges, rtol=1e-15)
    assert np.nanmax(found.D2_min) <= 1e-26 * first.box.edges.max() ** 2


def test_few_neighbours_determine_no_map():
    first = random_packing(20, 0.05, 3, js.Spherocylinders(alpha=0), 2)
    found = js.nonaffine(first, first, neighbours=1e-3)
    assert (found.n_neighbours == 0).all()
    assert np.isnan(found.D2_min).all()
    assert "nan" in repr(found)


def test_states_of_other_particles_are_refused(packing, tmp_path):
    other = packing.with_(id=packing.id + 1)
    with pytest.raises(
        ValueError, match=r"particle 1 is in only one of the states \(2 such particles\), expected"
    ):
        js.nonaffine(packing, other)
    space = random_packing(6, 0.1, 1, js.Dimers(), 3)
    with pytest.raises(ValueError, match="the second state has 3 dimensions, expected 2"):
        js.nonaffine(packing, space)
    with pytest.raises(ValueError, match="neighbours is -1"):
        js.nonaffine(packing, packing, neighbours=-1.0)
    js.save(tmp_path / "a.h5", packing)
    assert js.nonaffine(tmp_path / "a.h5", packing).D2_min.max() < 1e-20
