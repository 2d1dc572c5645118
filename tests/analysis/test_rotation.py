"""Rates of rotation, and stress by class of contact, of sheared packings."""

import numpy as np
import pytest

import jamshape as js
from common.contact_classes import class_stress
from common.rotation import rotation_rates
from jamshape.contacts import Contacts
from jamshape.flow.host import Host
from jamshape.flow.implicit import Flow, follow
from jamshape.flow.slow_shear import SlowShear
from jamshape.landscape import Landscape, State
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing


@pytest.fixture(scope="module")
def sheared():
    start = random_packing(16, 0.3, 1, js.Spherocylinders(alpha=4))
    landscape = Landscape(start)
    flow = Flow(compressed_to(landscape, State.of(start), 0.88, 5e-3))
    list(follow(landscape, flow, SlowShear(gdot=1e-4, strain_end=0.02)))
    return flow.state.packing(start)


def test_rates_are_how_angles_change(sheared):
    landscape, flow = Landscape(sheared), Flow(State.of(sheared))
    before = flow.state.orientation[:, 0]
    step = next(follow(landscape, flow, SlowShear(gdot=1e-4, strain_end=1e-9, tolerance=1e-6)))
    found = ((flow.state.orientation[:, 0] - before) / step.time).astype(float)
    rates = rotation_rates(sheared, Host.shearing(1e-4, "simple"))
    np.testing.assert_allclose(rates, found, rtol=1e-3, atol=1e-3 * np.abs(found).max())


def test_classes_of_contact_carry_all_of_the_stress(sheared):
    found = class_stress(Contacts.of(sheared))
    assert set(found) == {0, 1, 2}
    whole = Landscape(sheared).stress(State.of(sheared))
    np.testing.assert_allclose(sum(found.values()), whole, rtol=1e-9, atol=1e-12)
