"""Scenes that several of the tests here run on."""

import pytest
from every_shape import ALL, MIXTURES, SIDES, TYPICAL, in_a_small_box, pressed, tilted

from jamshape.contacts import find_contacts

SCENES = [
    *(pytest.param((pressed, case), id=str(case)) for case in ALL),
    *(pytest.param((in_a_small_box, case), id=f"{case}-small") for case in (*TYPICAL, *MIXTURES)),
    *(pytest.param((tilted, case), id=f"{case}-tilted") for case in (*TYPICAL, *MIXTURES)),
]


@pytest.fixture(scope="module", params=SCENES)
def packing(request):
    """Particles that are pressed together, in boxes longer and shorter than they are, and with a tilt."""
    make, case = request.param
    return make(case)


@pytest.fixture
def network(packing):
    return find_contacts(packing, sides=SIDES)
