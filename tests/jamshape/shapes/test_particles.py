"""Distributions of particles, and the options that name them."""

import re
from argparse import ArgumentParser

import numpy as np
import pytest

from jamshape.shapes.command_line import add_particle_options, particles_of
from jamshape.shapes.particles import Kind, Particles, parse_kind
from jamshape.shapes.table import guess_shape_style


def drawn(particles, n=100, seed=1):
    return particles.sample(n, np.random.default_rng(seed))


def from_options(*options):
    parser = ArgumentParser()
    add_particle_options(parser)
    return particles_of(parser.parse_args(options))


def test_small_and_big_ones_are_of_the_same_number_and_one_more_small():
    sizes = drawn(Particles.of(alpha=3.0, size_ratio=2.0), 101)
    assert np.bincount(sizes.species).tolist() == [0, 51, 50]
    np.testing.assert_array_equal(sizes.diameters[:, 1], np.where(sizes.species == 1, 1.0, 2.0))
    np.testing.assert_allclose(sizes.diameters[:, 0] / sizes.diameters[:, 1], 4.0, rtol=1e-15)


def test_equal_particles_are_of_one_kind():
    assert set(drawn(Particles.of(size_ratio=1.0)).species) == {1}
    assert set(drawn(Particles.of("superellipsoid", exponent=2.0)).species) == {1}


def test_shares_are_kept_to_a_particle():
    kinds = [Kind({"alpha": 0.0}, share=2), Kind({"alpha": 1.0}, share=1), Kind(share=0.5)]
    sizes = drawn(Particles.mixture("spherocylinder", kinds), 70)
    assert np.bincount(sizes.species)[1:].tolist() == [40, 20, 10]
    alpha = sizes.diameters[:, 0] / sizes.diameters[:, 1] - 1
    np.testing.assert_allclose(alpha, np.array([0.0, 1.0, 4.0])[sizes.species - 1], atol=1e-15)


def test_spread_is_that_of_the_logarithm_of_the_size():
    sizes = drawn(Particles.mixture("spherocylinder", [Kind(size=2.0, spread=0.2)]), 20_000)
    logs = np.log(sizes.diameters[:, 1])
    assert logs.std() == pytest.approx(0.2, rel=0.03)
    assert logs.mean() == pytest.approx(np.log(2.0), abs=0.01)


def test_options_name_particles_as_python_does():
    assert from_options().told == Particles.of().told
    assert from_options("--alpha", "1", "--size-ratio", "2").told == {"alpha": 1, "size_ratio": 2}
    boxes = from_options("--shape", "superellipsoid", "--p", "2", "--w1", "0.5")
    assert boxes.told == {"exponent": 2.0, "w1": 0.5, "w2": 1.0}
    kinds = ("--shape", "superellipsoid", "--kind", "p=2,share=3", "--kind", "w1=0.5,size=2")
    sizes = drawn(from_options(*kinds), 8)
    assert sizes.form[:, 0].tolist() == [2.0] * 6 + [1.0] * 2
    assert parse_kind("alpha=4, size=1.4") == Kind({"alpha": 4.0}, 1.4)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        (("--p", "2"), "--p does not apply to spherocylinders, expected --alpha"),
        (
            ("--kind", "beta=2"),
            "beta is not a parameter of spherocylinders, expected one of alpha, size",
        ),
        (("--kind", "alpha=2", "--alpha", "3"), "--kind excludes --size-ratio and a shape"),
        (("--kind", "alpha=2,share=0"), r"share is 0\.0, expected a share from 1e-06 to 1e\+06"),
        (("--kind", "alpha=2,spread=-1"), r"spread is -1\.0, expected a spread from 0 to 1"),
        (("--alpha", "-1"), r"alpha is -1\.0, expected 0 or A / R from 1e-06 to 100"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, sentence, capsys):
    with pytest.raises((ValueError, SystemExit)) as error:
        from_options(*options)
    said = str(error.value) if error.type is ValueError else capsys.readouterr().err
    assert re.search(sentence, said)


def test_an_empty_mixture_is_refused():
    with pytest.raises(ValueError, match="has no kinds, expected at least one"):
        Particles.mixture("spherocylinder", [])


def test_unknown_shapes_are_refused():
    with pytest.raises(ValueError, match="shape style is 'cube', expected one of spherocylinder"):
        Particles.of("cube")
    with pytest.raises(ValueError, match="fit no shape, expected positive lengths"):
        guess_shape_style(np.array([[1.0, -1.0, 2.0]]))
