"""`js.energy` of every shape against differences of U, and against itself."""

from functools import partial

import numpy as np
import pytest
from every_shape import (
    EPS,
    MIXTURES,
    ROUNDING,
    SIDES,
    TYPICAL,
    as_vectors,
    close_to,
    laws,
    pressed,
    size_of,
    tilted,
)
from lammps_runs import loaded, state_of
from slopes import assert_is_slope

import jamshape as js
from jamshape.contacts import find_contacts
from jamshape.landscape import Landscape
from jamshape.packing import State

WANTED = {"hessian": True, "compatibility": True}


def by_each_law(packing):
    """The packing with a stiffness other than 1, each number of bonds side to side, and Hertz's law."""
    harmonic = [js.Interaction(2.5, sides) for sides in laws(packing)]
    hertz = js.Interaction(2.5, SIDES, "hertz")
    return [packing.with_(law=law) for law in (*harmonic, hertz)]


def step_of(packing):
    lengths = Landscape(packing).rotation_length
    return 2e-6 * float(np.min([packing.inner_radius.min(), *lengths[lengths > 0]]))


def kinds_of_motion(packing, seed=5):
    """A random displacement, and a random rotation of what can rotate, the largest component of each 1."""
    rng, D = np.random.default_rng(seed), packing.dimension
    shift = rng.uniform(-1, 1, (packing.n, D))
    turn = rng.uniform(-1, 1, (packing.n, 1 if D == 2 else 3)) * ~packing.is_round[:, None]
    motions = [(shift, 0 * turn), (0 * shift, turn)]
    return [(a / size, b / size) for a, b in motions if (size := np.abs([*a.flat, *b.flat]).max())]


def moved(packing, motion, s):
    return State.of(packing).displaced(*(s * part for part in motion)).packing(packing)


def along(e, motion):
    """Minus the forces and torques along a motion."""
    return -sum(
        (a * b).sum() for a, b in zip((e.forces, as_vectors(e.torques)), motion, strict=True)
    )


def flat(e, forces, torques):
    """Values of particles as values of the coordinates."""
    return np.column_stack([forces, torques])[e.coordinates.particle, e.coordinates.kind]


def test_forces_and_torques_are_slopes_of_u_per_length_and_radian(packing):
    for own in by_each_law(packing):
        e, h, size = js.energy(own), step_of(own), np.abs(own.position).max()
        bond = np.linalg.norm(e.contacts.bonds.force, axis=1).mean()
        for motion in kinds_of_motion(own):
            scale = bond * np.linalg.norm(np.column_stack(motion))
            scale *= max(1.0, own.outer_radius.max()) if motion[1].any() else 1.0
            assert_is_slope(
                along(e, motion),
                lambda s, m=motion, p=own: js.energy(moved(p, m, s)).U,
                h,
                scale,
                size,
            )


def test_the_hessian_in_plain_units_is_the_slope_of_forces_and_torques(packing):
    for own in by_each_law(packing):
        require_hessian(own)


def require_hessian(packing):
    e, h, size = js.energy(packing, hessian=True), step_of(packing), np.abs(packing.position).max()
    scale = np.abs(e.hessian).max()

    def gradient(s, motion):
        at = js.energy(moved(packing, motion, s))
        return -flat(e, at.forces, as_vectors(at.torques))

    for motion in kinds_of_motion(packing):
        d = flat(e, *motion)
        of = partial(gradient, motion=motion)
        if motion[1].any():  # rotations in space do not commute: only the slope along themselves
            length = d @ d
            assert_is_slope(
                d @ e.hessian @ d, lambda s, f=of, d=d: f(s) @ d, h, length * scale, size
            )
        else:
            assert_is_slope(e.hessian @ d, of, h, np.abs(d).sum() * scale, size)
    assert abs(e.hessian - e.hessian.T).max() <= ROUNDING * scale


def test_pivots_count_the_rank_of_singular_values(packing, monkeypatch):
    for own in by_each_law(packing):
        exact = js.energy(own, compatibility=True).compatibility.constraints
        with monkeypatch.context() as patch:
            patch.setattr("jamshape.vibration.statistics._DENSE", 2)
            found = js.energy(own, compatibility=True).compatibility.constraints
        assert (exact.method, found.method) == ("svd", "pivots")
        assert found[:4] == exact[:4]


@pytest.mark.parametrize("rotation", ["radian", "half_length", "radius"])
def test_the_product_and_the_bonds_agree_with_the_hessian(packing, rotation):
    for own in by_each_law(packing):
        e = js.energy(own, rotation=rotation, **WANTED)
        bonds, scale = e.compatibility, np.abs(e.hessian).max()
        v = np.random.default_rng(3).normal(size=(e.coordinates.size, 2))
        expected = e.hessian @ v
        tolerance = 10 * ROUNDING * scale * np.abs(v).sum()
        np.testing.assert_allclose(e.hessian_product @ v, expected, rtol=0, atol=tolerance)
        np.testing.assert_allclose(e.hessian_product.T @ v, expected, rtol=0, atol=tolerance)
        C = bonds.matrix
        again = C.T @ (bonds.stiffness[:, None] * (C @ v)) - bonds.prestress @ v
        np.testing.assert_allclose(again, expected, rtol=0, atol=tolerance)
        known = bonds.constraints
        assert known.n_bonds == known.rank + known.n_self_stress == len(bonds.force)
        # The rank does not depend on the unit of rotations; nearly round particles have tiny torques.
        natural = js.energy(own, rotation="half_length", compatibility=True).compatibility
        dense = np.sqrt(natural.stiffness)[:, None] * natural.matrix.toarray()
        largest = np.linalg.norm(dense, 2)
        assert known.rank == np.linalg.matrix_rank(dense, 1e-6 * largest)
        assert len(bonds.force) == len(e.contacts.bonds.force)


def test_bond_forces_add_up_to_the_net_forces_and_torques(packing):
    for own in by_each_law(packing):
        e = js.energy(own, compatibility=True)
        found = e.compatibility.matrix.T @ e.compatibility.force
        force, torque = size_of(e.contacts.network)
        expected = flat(e, e.forces, as_vectors(e.torques))
        # Two bonds that share an energy also push and turn the particles by what their share changes.
        free = flat(e, *free_of_shared_bonds(own)).astype(bool)
        np.testing.assert_allclose(
            found[free], expected[free], rtol=0, atol=100 * ROUNDING * max(force, torque)
        )


def free_of_shared_bonds(packing):
    """Ones for particles all of whose bonds act along their normals, as vectors; zeros for others."""
    network = find_contacts(packing)
    bonds = network.bonds
    across = bonds.force - (bonds.force * bonds.normal).sum(axis=1, keepdims=True) * bonds.normal
    along = np.linalg.norm(bonds.force, axis=1)
    overlap = (bonds.reach - bonds.distance) / bonds.reach
    whole = packing.law.k_e * overlap / bonds.reach  # the force of a bond that shares no energy
    is_part = (network.n_bonds[bonds.contact] > 1) & (np.abs(along - whole) > 1e-9 * whole)
    shared = is_part | (np.linalg.norm(across, axis=1) > 1e-9 * along)
    found = np.ones((packing.n, 1))
    found[network.pairs[bonds.contact[shared]].ravel()] = 0
    D = packing.dimension
    return np.repeat(found, D, axis=1), np.repeat(found, 1 if D == 2 else 3, axis=1)


def test_sums_over_particles_are_those_of_the_packing(packing):
    for own in by_each_law(packing):
        e, V = js.energy(own), own.box.volume
        force, _ = size_of(e.contacts.network)
        assert np.abs(e.forces.sum(axis=0)).max() <= 10 * own.n * EPS * force
        assert e.energies.sum() == close_to(e.U, ROUNDING)
        assert e.U == close_to(e.contacts.bonds.energy.sum(), ROUNDING) == own_energy(own)
        pressed = np.abs(e.pressure_tensor).max()
        np.testing.assert_allclose(
            -e.stress.sum(axis=0) / V, e.pressure_tensor, rtol=0, atol=ROUNDING * pressed
        )
        stress = Landscape(own).stress(State.of(own))
        np.testing.assert_allclose(e.pressure_tensor, stress, rtol=0, atol=10 * ROUNDING * pressed)
        assert e.u == e.U / V
        assert (e.contacts.bonds.overlap > 0).all()


def own_energy(packing):
    return close_to(Landscape(packing).evaluate(State.of(packing)).energy, ROUNDING)


@pytest.mark.lammps
@pytest.mark.parametrize("make", [pressed, tilted])
@pytest.mark.parametrize("case", [*TYPICAL, *MIXTURES], ids=str)
def test_lammps_has_the_same_forces_torques_energies_and_stresses(case, make, tmp_path):
    packing = make(case).with_(law=js.Interaction(2.5, 2))
    per_atom, vector, array = 1, 1, 2
    with loaded(packing, tmp_path, sides="two", k_e=2.5) as session:
        session.commands(
            "compute stressed all stress/atom NULL\ncompute each all pe/atom\n"
            "compute both all reduce sum c_stressed[1] c_each\n"
            "thermo_style custom step pe pxx pyy pxy c_both[1] c_both[2]\n"
            "thermo_modify norm no\nrun 0"
        )
        found = state_of(session, packing)
        table = session.lmp.numpy.extract_compute("state", per_atom, array)
        order = np.argsort(table[:, 0])
        stress = session.lmp.numpy.extract_compute("stressed", per_atom, array)[order]
        each = session.lmp.numpy.extract_compute("each", per_atom, vector)[order]
        U, pxx, pyy, pxy = (session.lmp.get_thermo(name) for name in ("pe", "pxx", "pyy", "pxy"))
    e = js.energy(packing.sorted_by_id())
    force, torque = size_of(e.contacts.network)
    np.testing.assert_allclose(found.force, e.forces, rtol=0, atol=1e3 * ROUNDING * force)
    np.testing.assert_allclose(
        found.torque, e.torques, rtol=0, atol=1e3 * ROUNDING * max(force, torque)
    )
    assert close_to(e.U, 1e3 * ROUNDING) == U
    np.testing.assert_allclose(each, e.energies, rtol=0, atol=1e3 * ROUNDING * e.U)
    scale = np.abs(e.stress).max()
    # Of shears of x along y and so on: r_y f_x.
    for column, (k, l) in enumerate([(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]):
        if max(k, l) < packing.dimension:
            np.testing.assert_allclose(
                stress[:, column], e.stress[:, k, l], rtol=0, atol=1e3 * ROUNDING * scale
            )
    expected = [e.pressure_tensor[place] for place in ((0, 0), (1, 1), (0, 1))]
    np.testing.assert_allclose(
        [pxx, pyy, pxy], expected, rtol=0, atol=1e3 * ROUNDING * np.abs(expected).max()
    )
