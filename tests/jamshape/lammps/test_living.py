"""States of a living LAMMPS instance: read as packings, and pushed back."""

import numpy as np
import pytest
from exchanged import PLACES, mixed, tilted

import jamshape as js
from jamshape.contacts import Contacts
from jamshape.front.packing import public
from jamshape.lammps.module import one_at_a_time
from jamshape.lammps.session import Session
from jamshape.packing import Box

pytestmark = pytest.mark.lammps


def loaded(session, packing, law):
    session.load(packing)
    session.interact(law)


def plain(packing):
    """IDs from 1 and types as LAMMPS has them: what a session loads."""
    types = packing.shape.style(packing, js.Interaction()).types
    return packing.with_(id=1 + np.argsort(np.argsort(packing.id)), species=types).sorted_by_id()


def signed(quaternions, like):
    """Choose of q and -q the one as in a packing."""
    same = (quaternions * like.quaternions).sum(axis=1, keepdims=True)
    return np.where(same < 0, -quaternions, quaternions)


@pytest.mark.parametrize(("name", "dimension"), PLACES)
@pytest.mark.parametrize("make", [mixed, tilted])
@pytest.mark.parametrize("sides", [1, 2])
def test_a_living_state_is_read_with_its_law_and_pushed_back(name, dimension, make, sides):
    packing, law = make(name, dimension), js.Interaction(2.5, sides)
    expected = plain(packing)
    with Session() as session:
        loaded(session, packing, law)
        found = js.load(session)
        assert (found.shape_style, found.dimension, found.n) == (name, dimension, packing.n)
        assert found.law == (law if packing.compiled().has_sides else js.Interaction(2.5))
        for field in ("species", "id", "form", "diameters"):
            np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))
        np.testing.assert_array_equal(found.box.matrix, expected.box.matrix)
        unwrapped = [p.position + p.box.vectors(p.image) for p in (found, expected)]
        scale = packing.box.edges.max()
        np.testing.assert_allclose(*unwrapped, atol=1e-14 * scale)
        box = Box(found.box.lo + 0.25, found.box.edges * 1.125, found.box.tilt * 0.5)
        moved = found.with_(
            position=found.position * 1.25 + 0.125,
            orientation=found.orientation[::-1],
            image=found.image + 1,
            box=box,
        )
        public(moved).to_lammps(session.lmp)
        again = js.load(session.lmp)
        turns = again.image - moved.image
        shifted = again.position + again.box.vectors(turns)
        np.testing.assert_allclose(shifted, moved.position, atol=1e-14 * scale)
        np.testing.assert_array_equal(
            again.box.edges, (moved.box.lo + moved.box.edges) - moved.box.lo
        )
        for field in ("id", "species", "diameters", "form"):
            np.testing.assert_array_equal(getattr(again, field), getattr(moved, field))
        np.testing.assert_allclose(again.quaternions, signed(moved.quaternions, again), atol=1e-15)


def test_energy_of_lammps_is_that_of_its_packing():
    packing = js.make_packing(js.Spherocylinders(alpha=1), n=16, u0=1e-6, progress=False)
    with Session() as session:
        loaded(session, packing, js.Interaction(3.0, 2))
        session.commands("thermo_style custom step pe\nthermo_modify norm no\nrun 0")
        found = js.load(session)
        energy = Contacts.of(found).energy.sum()
        with one_at_a_time():
            pe = session.lmp.get_thermo("pe")
        assert pe == pytest.approx(energy, rel=1e-9)
        turned = public(found.with_(orientation=found.orientation + 0.01))
        turned.to_lammps(session)
        session.commands("run 0")
        with one_at_a_time():
            pe = session.lmp.get_thermo("pe")
        assert pe == pytest.approx(Contacts.of(turned).energy.sum(), rel=1e-9)


def test_what_a_packing_does_not_hold_is_said():
    packing = mixed("spherocylinder", 2)
    with Session() as session:
        loaded(session, packing, js.Interaction())
        with pytest.raises(ValueError, match="has dimension 2, expected 3"):
            js.load(session, dimension=3)
        session.commands("fix hold all setforce 0 0 0")
        with pytest.warns(UserWarning, match="has the fixes setforce: the packing has only the"):
            js.load(session)


def test_another_pair_style_leaves_the_shape_to_the_user():
    with Session() as session:
        session.load(mixed("dimer", 3))
        session.commands("pair_style zero 1.0\npair_coeff * *")
        with pytest.warns(UserWarning, match="the LAMMPS instance does not state the shape"):
            assert js.load(session).shape_style == "spherocylinder"
        assert js.load(session, shape="dimer").shape_style == "dimer"


def test_other_particles_are_refused():
    packing = mixed("spherocylinder", 2)
    with Session() as session:
        loaded(session, packing, js.Interaction())
        found = js.load(session)
        other = found.with_(id=found.id + 1)
        with pytest.raises(ValueError, match="atoms of other IDs than the packing"):
            other.to_lammps(session)
        smaller = public(mixed("spherocylinder", 2, n=6))
        with pytest.raises(ValueError, match="has 12 atoms in 2D, expected the 6 particles in 2D"):
            smaller.to_lammps(session)


class TwoRanks:
    """An instance of two processes, as far as it is asked."""

    lmp = 1

    def extract_box(self):
        raise AssertionError

    def extract_setting(self, name):
        return {"world_size": 2}[name]


def test_several_processes_and_frames_are_refused():
    with pytest.raises(ValueError, match="has 2 processes, expected one: write a data file"):
        js.load(TwoRanks())
    with pytest.raises(ValueError, match="frame is -1, expected none for a LAMMPS instance"):
        js.load(TwoRanks(), -1)
    with pytest.raises(ValueError, match="path is 3, expected a path or a LAMMPS instance"):
        js.load(3)


def test_an_instance_without_ellipsoids_is_refused():
    with Session() as session:
        with pytest.raises(
            ValueError, match="the LAMMPS instance has no atoms, expected particles"
        ):
            js.load(session)
        session.commands(
            "region b block 0 5 0 5 0 5\ncreate_box 1 b\nmass 1 1\ncreate_atoms 1 single 1 1 1"
        )
        with pytest.raises(ValueError, match="atoms that are not ellipsoids"):
            js.load(session)
