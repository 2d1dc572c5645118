import numpy as np
import pytest
from mixtures import bidisperse

from common.contact_angles import angle_curve, contact_angles
from common.contact_classes import NAMES, class_fractions, class_numbers, flat_fraction
from jamshape.contacts import find_contacts
from jamshape.files.h5md import write_packing
from jamshape.files.sets import PackingFile
from jamshape.packing import Box
from jamshape.protocols.random_start import random_packing


@pytest.fixture
def files(tmp_path):
    """Random packings, squeezed until they touch, with one rattler each."""
    paths = [tmp_path / f"{seed}.h5" for seed in (1, 2)]
    for seed, path in enumerate(paths, 1):
        packing = random_packing(20, 0.45, seed, bidisperse(1.0))
        while len(find_contacts(packing, sides=2).pairs) <= 20:
            box = Box(packing.box.lo, 0.99 * packing.box.edges)
            packing = packing.with_(position=0.99 * packing.position, box=box)
        write_packing(path, packing, {"outcome": "converged"}, {"rattler_ids": [3.0]})
    return [PackingFile.read(path) for path in paths]


def test_classes_and_flat_contacts_of_a_packing(files):
    found = files[0].contacts()
    numbers = class_numbers(found)
    assert tuple(numbers) == NAMES
    fractions = class_fractions(found.network, found.rattlers)
    assert numbers["side_to_side"] == fractions.side_to_side
    assert numbers["flat_of_all"] == flat_fraction(found.network, found.rattlers).of_all


def test_angles_are_averaged_over_samples(files):
    curve = angle_curve(1.0, files)
    contacts = [file.contacts() for file in files]
    angles = [contact_angles(one.packing, one.network, one.rattlers) for one in contacts]
    assert (curve.samples, curve.n_contacts) == (2, sum(map(len, angles)) // 2)
    area = (curve.density * np.diff(np.radians(curve.edges))).sum()
    assert area == pytest.approx(1.0)
    on_flat = np.mean([np.mean(a > np.pi / 4) for a in angles])
    assert curve.on_flat.value == pytest.approx(on_flat)
    assert 0 <= curve.peak_degrees <= 180
