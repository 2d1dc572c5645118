import numpy as np
import pytest
from mixtures import bidisperse

from common.spines import with_spines
from jamshape.protocols.random_start import random_packing


def test_discs_become_rods_of_the_same_radii_and_phi():
    discs = random_packing(30, 0.5, 3, bidisperse(0))
    rods = with_spines(discs, 0.01, 1)
    np.testing.assert_array_equal(rods.radius, discs.radius)
    np.testing.assert_allclose(rods.aspect_ratio, 0.01, rtol=1e-12)
    assert rods.phi == pytest.approx(discs.phi, rel=1e-14)
    np.testing.assert_allclose(
        rods.position / rods.box.edges, discs.position / discs.box.edges, rtol=1e-14
    )
    assert len(np.unique(rods.orientation)) == 30
    with pytest.raises(ValueError, match=r"half lengths up to .*, expected discs"):
        with_spines(rods, 0.01, 1)
