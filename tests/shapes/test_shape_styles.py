"""The pair style of every shape in LAMMPS: the same forces, and all that LAMMPS does with them."""

import numpy as np
import pytest
from every_shape import (
    ALL,
    MIXTURES,
    SIDES,
    TYPICAL,
    in_a_small_box,
    laws,
    pressed,
    scattered,
    squeezed,
)
from in_lammps import fix_value, forces_of, holding, law_of, on_ranks, vector_of

from jamshape.contacts import coordination, find_contacts, find_rattlers, forces, sum_forces
from jamshape.files.lammps_text import read_data, read_dump, write_data
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.measures.minimum import order

pytestmark = pytest.mark.lammps

# Of the largest force and torque of a contact: a few hundred roundings.
ROUNDING = 1e-13

SCENES = {
    **{str(case): (pressed, case) for case in ALL},
    **{f"{case}-small": (in_a_small_box, case) for case in (*TYPICAL, *MIXTURES)},
}


def made(name):
    make, case = SCENES[name]
    return with_odd_ids(make(case))


def with_odd_ids(packing, seed=3):
    """Shuffled, with gaps."""
    ids = 1 + np.random.default_rng(seed).permutation(3 * packing.n)[: packing.n]
    return packing.with_(id=ids)


def assert_same_forces(packing, law, found, measured):
    """Energy, pressure, forces and torques in the order of the IDs are those of the library."""
    energy, pressure, force, torque = found
    network = find_contacts(packing, law.k_e, law.sides)
    expected, order_of_ids = sum_forces(packing, network), np.argsort(packing.id)
    largest = np.abs(network.force).max()
    torques = max(np.abs([network.torque_i, network.torque_j]).max(), largest)
    off = np.abs(force - expected.force[order_of_ids]).max() / largest
    off_torque = np.abs(torque - expected.torque[order_of_ids]).max() / torques
    measured(force=off, torque=off_torque)
    assert off <= ROUNDING
    assert off_torque <= ROUNDING
    assert energy == pytest.approx(expected.energy, rel=ROUNDING)
    assert pressure == pytest.approx(expected.pressure, rel=ROUNDING)
    assert len(network.pairs) >= 3


CASES = [(name, newton, law) for name in SCENES for newton in ("on", "off") for law in (0, 1)]


def law_number(packing, number):
    """The first or second law of a shape; None if there is none."""
    known = laws(packing)
    return law_of(known[number]) if number < len(known) else None


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("name", SCENES)
def test_forces_are_those_of_the_library(name, newton, measured):
    packing = made(name)
    for law in map(law_of, laws(packing)):
        with holding(packing, law, newton) as session:
            session.commands("run 0")
            thermo = [session.lmp.get_thermo(key) for key in ("pe", "press", "pxx", "pyy", "pxy")]
            force, torque = forces_of(session)
        assert_same_forces(packing, law, (*thermo[:2], force, torque), measured)
        virial = forces(packing, law.k_e, law.sides).virial / packing.box.volume
        stress = [virial[0, 0], virial[1, 1], virial[0, 1]]
        np.testing.assert_allclose(thermo[2:], stress, 0, ROUNDING * np.abs(virial).max())


@pytest.fixture(scope="module")
def on_two_ranks(tmp_path_factory):
    """Every scene with both settings of newton, all in one process."""
    inputs = {}
    for name in SCENES:
        packing = made(name)
        for newton in ("on", "off"):
            inputs[name, newton] = packing, law_of(SIDES), newton
    return inputs, on_ranks(inputs, tmp_path_factory.mktemp("ranks"))


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("name", SCENES)
def test_forces_on_two_ranks_are_those_of_the_library(name, newton, on_two_ranks, measured):
    inputs, found = on_two_ranks
    packing, law, _ = inputs[name, newton]
    assert_same_forces(packing, law, found[name, newton], measured)
