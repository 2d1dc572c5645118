"""Packings of the whole path, N = 256 at u0 = 1e-15, are minima: see tests/minima.py.

Modes of rods that slide along flat sides have eigenvalues of the second order in the overlap, 1e-15 and
far below what rounding makes of a zero in the dense Hessian. At alpha = 4 most of them are negative, the
more so the more rods slide: the slope of the energy there is below any tolerance on forces. All other
modes go up.
"""

import numpy as np
import pytest
from minima import complaints, dense, probes, soft_directions, typical_overlap, unconstrained
from mixtures import bidisperse

from jamshape.files.h5md import read_attributes, read_packing
from jamshape.landscape import Landscape, State
from jamshape.minima import History, Minimum, Outcome, residual_of
from jamshape.protocols.approach import Approach
from jamshape.protocols.make import Dynamics, Recipe, make

pytestmark = [pytest.mark.lammps, pytest.mark.validate]

ALPHAS, SEEDS = (0.0, 0.01, 1.0, 4.0), (21, 22)


@pytest.fixture(
    scope="module",
    params=[(alpha, seed) for alpha in ALPHAS for seed in SEEDS],
    ids=lambda sample: "alpha {:g}, seed {}".format(*sample),
)
def found(request, tmp_path_factory):
    alpha, seed = request.param
    out = tmp_path_factory.mktemp("packing") / "packing.h5"
    recipe = Recipe(bidisperse(alpha), seed=seed, way=Dynamics(Approach(kappa=4e-6)))
    make(recipe, out)
    packing = read_packing(out)
    landscape, state = Landscape(packing), State.of(packing)
    evaluation, outcome = landscape.evaluate(state), Outcome(read_attributes(out)["outcome"])
    residual = residual_of(landscape, evaluation)
    return landscape, Minimum(state, evaluation, outcome, residual, History())


def test_no_neighbour_is_lower_and_no_mode_goes_down(found, measured):
    landscape, minimum = found
    assert minimum.outcome in {Outcome.CONVERGED, Outcome.SLIDING}
    assert complaints(landscape, minimum, n_random=10, n_soft=40) == []
    state, overlap = minimum.state, typical_overlap(landscape, minimum.state)
    along = list(probes(landscape, minimum, soft_directions(landscape, state, 40)))
    soft, eigen = unconstrained(landscape, state), dense(landscape, state)
    first_order = np.abs(soft.values) > 20 * overlap**2
    measured(
        lowest=eigen.values[0],
        rounding=eigen.rounding,
        soft=len(soft.values),
        first_order=first_order.sum(),
        lowest_of_first_order=min(soft.values[first_order], default=np.nan),
        negative=(soft.values < -soft.rounding).sum(),
        lowest_of_second_order=soft.values[0],
        known_to_be_higher=sum(p.is_higher for p in along) / len(along),
        residual=minimum.residual.largest,
    )
    if landscape.particles.aspect_ratio.max() < 0.1:
        assert soft.values[0] >= -soft.rounding  # sides this short end before anything slides
