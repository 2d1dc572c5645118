"""Boxes that yield: pressure tensors are those asked for, and the enthalpy has a minimum there."""

import math
from functools import cache

import numpy as np
import pytest
from thinned import in_turn

import jamshape as js
from jamshape.checks import ArgumentError
from jamshape.landscape import CrossingError, Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.minima.boxes import Settling, Yielding, advance, strains_of
from jamshape.minima.target import TargetError
from jamshape.packing.box import COMPONENTS

SCENES = {
    "discs": (js.Spherocylinders(alpha=0), 24, 2),
    "rods": (js.Spherocylinders(alpha=1), 16, 2),
    "long rods": (js.Spherocylinders(alpha=4), 12, 2),
    "dimers": (js.Dimers(), 16, 2),
    "squares": (js.Superellipsoids(p=2), 12, 2),
    "spheres": (js.Superellipsoids(p=1, w1=1, w2=1), 20, 3),
    "spheroids": (js.Superellipsoids(p=1, w1=0.7, w2=1), 14, 3),
    "rods in space": (js.Spherocylinders(alpha=1), 12, 3),
}


@cache
def jammed(name):
    """A packing in a cubic box, under shear stress."""
    particles, n, dimension = SCENES[name]
    return js.make_packing(particles, n=n, dimension=dimension, seed=1, u0=1e-5, progress=False)


@cache
def at_pressure(name, pressure):
    packing = jammed(name)
    landscape = Landscape(packing)
    return landscape, Yielding("free", pressure=pressure).find(landscape, State.of(packing))


@pytest.mark.parametrize("box", ["isotropic", "free", "xx", "yy xy", "xx yy"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_only_the_first_strain_changes_the_volume(box, dimension):
    strains = strains_of(box, dimension)
    traces = np.trace(strains, axis1=1, axis2=2)
    assert traces[0] == max(1, sum(word[0] == word[1] for word in box.split())) or box in {
        "isotropic", "free",
    }  # fmt: skip
    np.testing.assert_allclose(traces[1:], 0, atol=1e-15)
    assert not np.tril(strains, -1).any()
    flat = strains.reshape(len(strains), -1)
    assert np.linalg.matrix_rank(flat) == len(flat)
    if box == "free":
        assert len(flat) == len(COMPONENTS[dimension])


@pytest.mark.parametrize(("name", "pressure"), in_turn(list(SCENES), [1e-2, 1e-5, 1e-8]))
def test_the_stress_is_the_pressure_and_nothing_else(name, pressure):
    landscape, found = at_pressure(name, pressure)
    again = js.energy(found.state.packing(landscape.particles)).pressure_tensor
    D = len(again)
    np.testing.assert_allclose(again, pressure * np.eye(D), rtol=0, atol=2e-8 * pressure)
    assert found.residual.largest <= 1e-8


@pytest.mark.parametrize("name", ["discs", "long rods", "spheres"])
def test_the_enthalpy_rises_with_every_strain(name):
    """Also where particles relax: by the quadratic form that is positive at a minimum."""
    pressure = 1e-2
    landscape, found = at_pressure(name, pressure)
    volume, here = found.state.volume, found.evaluation.energy
    numbers = np.random.default_rng(3)
    D = found.state.dimension
    for _ in range(4):
        strain = 1e-5 * np.triu(numbers.uniform(-1, 1, (D, D)))
        rises = []
        for sign in (1, -1):
            matrix = np.eye(D, dtype=np.longdouble) + sign * np.longdouble(strain)
            there = minimise(landscape, found.state.deformed(matrix), "near", Stop(1e-10))
            change = volume * float(np.prod(np.diagonal(matrix)) - 1)
            rises.append(there.evaluation.energy - here + pressure * change)
        assert min(rises) > 0
        # Both ways alike: the slope is 0 beside the curvature.
        assert abs(rises[0] - rises[1]) < 0.05 * sum(rises)


@pytest.mark.parametrize("name", ["discs", "long rods", "dimers", "spheres"])
def test_the_same_state_by_its_energy(name):
    landscape, found = at_pressure(name, 1e-5)
    again = Yielding("free", u0=found.energy_density).find(landscape, found.state)
    assert again.energy_density == pytest.approx(found.energy_density, rel=1e-8)
    assert again.state.volume == pytest.approx(found.state.volume, rel=1e-12)
    at_phi = Yielding("free", phi=found.state.packing(landscape.particles).phi)
    assert at_phi.find(landscape, found.state).energy_density == pytest.approx(
        found.energy_density, rel=1e-7
    )


@pytest.mark.parametrize("name", ["discs", "rods", "spheres"])
def test_components_that_are_held_keep_their_length(name):
    packing = jammed(name)
    landscape = Landscape(packing)
    found = Yielding("xx xy", pressure=1e-3).find(landscape, State.of(packing))
    tensor = landscape.stress(found.state)
    assert tensor[0, 0] == pytest.approx(1e-3, rel=1e-8)
    assert abs(tensor[0, 1]) < 1e-11
    assert found.state.edges[1] == State.of(packing).edges[1]
    assert abs(tensor[1, 1] / 1e-3 - 1) > 1e-3


@pytest.mark.parametrize("goal", [{"pressure": 1e-4}, {"u0": 1e-7}, {"phi": 0.9}], ids=str)
def test_it_goes_on_from_its_numbers(goal):
    """To the last bit, whenever it is put down."""
    packing, wanted = jammed("rods"), Yielding("free", **goal)
    landscape, whole, parts = Landscape(packing), *(Settling(State.of(packing)) for _ in range(2))
    while not whole.done:
        landscape.forget_pairs()
        advance(landscape, whole, wanted)
    while not parts.done:
        advance(Landscape(packing), parts, wanted)
    assert parts.n_steps == whole.n_steps
    assert (parts.state.position == whole.state.position).all()
    assert (parts.state.cell == whole.state.cell).all()


def test_an_unjammed_state_is_compressed_first():
    packing = js.make_packing(js.Spherocylinders(alpha=0), n=16, phi=0.6, progress=False)
    assert packing.u == 0
    assert packing.reached
    found = js.minimise(packing, pressure=1e-3, box="free", progress=False)
    assert found.pressure == pytest.approx(1e-3, rel=1e-8)


@pytest.mark.parametrize(
    ("name", "given", "said"),
    [
        ("xy", {"pressure": 1e-3}, "box='xy' keeps the volume, which pressure=0.001 needs to change"),
        ("zz", {"pressure": 1e-3}, "box is 'zz', expected isotropic, free or components such as 'xx'"),
        ("xx xx", {"phi": 0.8}, "box is 'xx xx', expected isotropic"),
        ("free", {}, "targets are none, expected one of pressure, u0 and phi"),
        ("free", {"u0": 1e-3, "phi": 0.8}, "targets are u0 and phi, expected one"),
        ("free", {"pressure": 2.0}, "pressure is 2.0, expected a pressure from 1e-12 to 1"),
        ("free", {"u0": 1e-30}, "u0 is 1e-30"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused(name, given, said):
    with pytest.raises((ValueError, ArgumentError)) as caught:
        Yielding(name, **given).find(Landscape(jammed("discs")), State.of(jammed("discs")))
    assert said in str(caught.value)


# --- many seeds, and extremes ---------------------------------------------------------------------

SIX = ("discs", "rods", "long rods", "dimers", "spheres", "spheroids")


@pytest.mark.validate
@pytest.mark.parametrize("name", SIX)
def test_every_seed_ends(name, measured):
    """At its pressure, without shear stress."""
    particles, n, dimension = SCENES[name]
    missed = []
    for seed in range(1, 21):
        given = {"n": n, "dimension": dimension, "seed": seed, "pressure": 1e-4, "box": "free"}
        try:
            packing = js.make_packing(particles, progress=False, **given)
        except TargetError:
            missed.append(seed)
            continue
        tensor = js.energy(packing).pressure_tensor
        np.testing.assert_allclose(tensor, 1e-4 * np.eye(dimension), rtol=0, atol=2e-12)
    measured(missed=len(missed))
    assert missed == []


@pytest.mark.validate
@pytest.mark.parametrize("box", ["isotropic", "free"])
@pytest.mark.parametrize("pressure", [1e-10, 1e-1])
@pytest.mark.parametrize(
    ("particles", "n", "dimension"),
    [
        (js.Spherocylinders(alpha=1e-3), 32, 2),
        (js.Spherocylinders(alpha=20), 8, 2),  # in a box shorter than a particle
        (js.Superellipsoids(p=1, w1=1, w2=1), 32, 3),
        (js.Spherocylinders(alpha=5), 12, 3),
    ],
    ids=str,
)
def test_extremes_end_at_the_target_or_in_a_sentence(particles, n, dimension, pressure, box):
    given = {"n": n, "dimension": dimension, "pressure": pressure, "box": box}
    said = ""
    try:
        found = js.make_packing(particles, progress=False, **given).pressure
    except (TargetError, CrossingError) as error:
        said, found = str(error), math.nan
    assert "expected" in said or found == pytest.approx(pressure, rel=1e-8)
