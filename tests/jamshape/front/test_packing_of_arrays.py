"""`js.Packing.of`: particles of any shape from plain arrays, and what is refused."""

import numpy as np
import pytest

import jamshape as js
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles
from jamshape.shapes.table import SHAPES

RODS = {"position": [[2, 5], [6, 5]], "orientation": [0, 1], "box": [10, 10]}


def of(shape="spherocylinder", **changes):
    return js.Packing.of(shape, **({"alpha": 4} | RODS | changes))


def fields_alike(one, other):
    names = set(type(one).__dataclass_fields__) - {"box", "results", "file", "exponent"}
    boxes = ((getattr(p.box, k) for k in ("lo", "edges", "tilt")) for p in (one, other))
    return all(np.array_equal(getattr(one, k), getattr(other, k)) for k in names) and all(
        map(np.array_equal, *boxes)
    )


PLACES = [(shape, D) for shape in SHAPES.values() for D in shape.dimensions]


@pytest.mark.parametrize(("shape", "dimension"), PLACES, ids=lambda x: getattr(x, "name", x))
def test_parameters_and_sizes_or_diameters_give_back_a_packing(shape, dimension):
    for parameters in shape.examples:
        packing = random_packing(6, 0.05, 1, Particles.of(shape, 1.4, **parameters), dimension)
        arrays = {"position": packing.position, "orientation": packing.orientation}
        arrays |= {"species": packing.species, "k_e": 2.0, "sides": 1}
        expected = packing.with_(law=js.Interaction(2.0, 1))
        size = [(1.0, 1.4)[k - 1] for k in packing.species]
        each = {
            name: value if isinstance(value, str) else np.full(6, value)
            for name, value in parameters.items()
        }
        by_option = {p.option: parameters[p.name] for p in shape.parameters if p.name in parameters}
        sizes = [{"size": size} | parameters, {"size": size} | each, {"size": size} | by_option]
        names = ("n1", "n2") if "n1" in parameters else ("exponent",) * shape.has_exponent
        exponent = {} if shape.has_form else dict(zip(names, packing.form.T, strict=True))
        if not shape.has_form:
            sizes.append({"diameters": packing.diameters} | exponent)
        for box in (packing.box, packing.box.edges, packing.box.matrix):
            for known in sizes:
                found = js.Packing.of(shape.name, **arrays, box=box, **known)
                assert isinstance(found, js.Packing)
                assert fields_alike(found, expected)
                assert found.contacts().packing is found


def test_cell_vectors_ids_images_and_the_corner_are_kept():
    found = of(box=[[10, 3], [0, 8]], lo=[-1, 2], id=[7, 3], image=[[0, 1], [0, 0]], species=[2, 1])
    assert found.box.matrix.tolist() == [[10, 3], [0, 8]]
    assert found.box.lo.tolist() == [-1, 2]
    assert (found.id.tolist(), found.species.tolist()) == ([7, 3], [2, 1])
    assert found.image.tolist() == [[0, 1], [0, 0]]
    assert found.results == {}
    assert found.file is None
    assert found.law == js.Interaction()


def test_each_particle_may_have_its_own_numbers():
    found = of(alpha=[0, 4], size=[1, 0.5])
    assert found.diameters.tolist() == [[1, 1, 1], [2.5, 0.5, 0.5]]
    many = js.Packing.of(
        "superellipsoid", [[1, 1, 1], [5, 5, 5]], [[1, 0, 0, 0]] * 2, box=[9, 9, 9],
        p=[1, 1.5], w1=[1, 0.5], w2=[2, 1], size=0.5,
    )  # fmt: skip
    assert many.diameters.tolist() == [[1, 1, 2], [1, 2, 2]]
    assert many.exponent.tolist() == [1, 1.5]


@pytest.mark.parametrize("dimension", [2, 3])
def test_round_particles_need_no_orientation(dimension):
    at, box = [[1] * dimension, [3] * dimension], [9] * dimension
    found = js.Packing.of("spherocylinder", at, box=box, alpha=0)
    assert found.is_round.all()
    assert np.isnan(found.S_2)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"shape": "disc"}, "shape style is 'disc', expected one of spherocylinder, "),
        ({"shape": "dimer", "alpha": 0}, "alpha is 0.0, expected A / R above 0"),
        ({"position": [[1, 2, 3], [4, 5, 6]]}, r"position has shape \(2, 3\), expected \(2, 2\)"),
        ({"position": [1, 2]}, r"position has shape \(2,\), expected \(2, 2\)"),
        ({"position": [[1, 2], [np.nan, 3]]}, "position holds NaN or infinity, expected finite"),
        ({"position": "here"}, "position has dtype .*, expected real numbers"),
        ({"orientation": [0]}, r"orientation has shape \(1,\), expected \(2,\)"),
        ({"orientation": None}, r"orientation is missing, expected \(2,\) angles of particles"),
        ({"alpha": [1, 2, 3]}, r"alpha has shape \(3,\), expected a number or \(2,\)"),
        ({"alpha": np.nan}, "alpha holds NaN or infinity, expected finite numbers"),
        ({"alpha": [1, -1]}, "alpha is -1.0, expected 0 or A / R from"),
        ({"alpha": "long"}, "alpha has dtype .*, expected real numbers"),
        ({"w1": 1}, "w1 is not a parameter of spherocylinders, expected alpha"),
        ({"size": 0}, "size holds 0.0, expected positive lengths"),
        ({"size": [[1], [1]]}, r"size has shape \(2, 1\), expected a number or \(2,\)"),
        ({"diameters": [[5, 1, 1]] * 2}, "alpha is given beside diameters, which determine it; le"),
        ({"box": [10]}, r"box has shape \(1,\), expected \(D,\) edges or \(D, D\) cell vectors"),
        ({"box": [10, -1]}, r"box edges are \[10.0, -1.0\], expected positive lengths"),
        ({"box": [[10, np.inf], [0, 10]]}, "box holds NaN or infinity, expected finite numbers"),
        ({"box": [[10, 0], [3, 10]]}, "box is the lower triangular matrix .*; transpose it$"),
        ({"box": [[10, 1], [3, 10]]}, "the cell vectors are the columns of .* rotate box and part"),
        ({"box": js.Box([0, 0], [9, 9]), "lo": [0, 0]}, "lo is given beside a Box, which has its"),
        ({"lo": [0]}, r"box lo has shape \(1,\), expected \(2,\)"),
        ({"id": [1, 1]}, "an id occurs more than once"),
        ({"species": [0, 1]}, "species holds 0, expected numbers from 1"),
        ({"image": [[0, 0]]}, r"image has shape \(1, 2\), expected \(2, 2\)"),
        (
            {"k_e": -1.0},
            r"law is Interaction\(k_e=-1.0, sides=2, power=2.0\), expected .* a positive k_e",
        ),
        ({"k_e": "stiff"}, "k_e is 'stiff', expected a positive number"),
        ({"sides": 3}, r"law is .*sides=3, power=2.0\), expected .* sides 1 or 2"),
    ],
)
def test_what_is_refused(changes, sentence):
    with pytest.raises(ValueError, match=f"^{sentence}"):
        of(**changes)


def test_what_is_missing_is_named():
    with pytest.raises(ValueError, match=r"^alpha of spherocylinders is missing, expected aspect"):
        js.Packing.of("spherocylinder", **RODS)
    with pytest.raises(
        ValueError, match=r"^w1 of superellipsoids is missing, expected a/b <= 1, or"
    ):
        js.Packing.of("superellipsoid", **RODS, p=1)
    with pytest.raises(ValueError, match=r"orientation is missing, expected \(1, 4\) quaternions"):
        js.Packing.of("dimer", [[1, 2, 3]], box=[9, 9, 9], alpha=1)


def test_a_state_that_is_no_minimum_has_its_numbers():
    """Two parallel rods side to side, and one that lies alone across."""
    packing = of(position=[[2, 5], [2, 5.9], [7, 5]], orientation=[0, 0, np.pi / 2])
    assert packing.n_rattlers == packing.rattlers.sum() == 3
    assert (packing.z, packing.z_single, packing.z_iso) == (0, 0, 6)
    assert pytest.approx(1 / 3) == packing.S_2
    assert pytest.approx(1) == packing.S_4
    assert np.isnan(packing.C_4)
    assert packing.u > 0
    solid = js.Packing.of(
        "spherocylinder", [[1, 1, 1], [5, 5, 5]], [[1, 0, 0, 0]] * 2, box=[9, 9, 9], alpha=1
    )
    assert (solid.S_2, solid.C_4, solid.z_iso) == (pytest.approx(1), pytest.approx(1), 10)
    assert np.isnan(solid.S_4)
