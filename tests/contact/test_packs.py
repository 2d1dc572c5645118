"""Contacts in packs: with every set of instructions those of one pair at a time, to rounding."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pair_packings import PairPacking, rods
from spherocylinder_pairs import concatenated, disc_to_disc, overlaps
from test_fuzz import kinds_of_rods

import jamshape as js
from jamshape import _contact
from jamshape.landscape import Landscape, State

K_E = 1.3
N = 333
PACKS = [name for name in _contact.instruction_sets() if name != "scalar"]
each_set = pytest.mark.parametrize("instructions", PACKS)


def every_kind(rng, dimension):
    """Pairs of all kinds in any order, every third apart, and some that cross."""
    kinds = [*kinds_of_rods(rng, N, dimension)]
    kinds.append(disc_to_disc(rng, N, dimension, overlaps(rng, N)))
    pairs = concatenated(*(pairs[:N] for pairs in kinds))
    pairs = pairs[rng.permutation(len(pairs))]
    away = np.where(np.arange(len(pairs)) % 3 == 0, 1.0 + rng.exponential(0.1, len(pairs)), 1.0)
    away[::97] = 0.0
    return pairs.replaced(r=away[:, None] * pairs.r)


def exponent(p):
    """Superellipsoids of one exponent."""
    return lambda diameters, ones, *more: _contact.Superellipsoids(diameters, p * ones, *more)


def superellipsoids(rng, dimension, p=1.0):
    """Bodies with the sizes and separations of those pairs: long, flat, of three axes, and all axes alike."""
    packing = PairPacking.of(rng, every_kind(rng, dimension), exponent(p))
    diameters = packing.diameters * (1.0 if p >= 1.0 else 1.5)  # so that corners touch, too
    diameters[0::5] = diameters[0::5, ::-1]
    diameters[1::5] *= rng.uniform(0.5, 1.0, diameters[1::5].shape)
    diameters[2::5] = diameters[2::5, 1:2]
    return replace(packing, diameters=diameters)


def spherocylinders(rng, dimension):
    """Rods with the sizes and separations of those pairs."""
    return PairPacking.of(rng, every_kind(rng, dimension))


def sums(monkeypatch, instructions, packing, sides):
    monkeypatch.setenv("JAMSHAPE_SIMD", instructions)
    return packing.sums(sides, K_E, extended=False)


def compare(monkeypatch, instructions, packing, sides, rounding=0.0):
    alone = sums(monkeypatch, "scalar", packing, sides)
    found = sums(monkeypatch, instructions, packing, sides)
    for name in ("n_bonds", "crossing", "unconverged"):
        assert found[name] == alone[name], name
    for name in ("force", "torque"):
        atol = rounding * np.abs(alone[name]).max()
        np.testing.assert_allclose(found[name], alone[name], rtol=0.0, atol=atol, err_msg=name)
    for name in ("energy", "virial", "bond_force"):
        atol = 1e-13 * np.abs(alone[name]).max()
        np.testing.assert_allclose(found[name], alone[name], rtol=0.0, atol=atol, err_msg=name)
    assert np.isfinite(found["force"]).all()
    assert 0.1 < np.mean(found["force"].any(axis=1)) < 0.95


@each_set
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("sides", [1, 2])
def test_packs_of_rods_give_what_pairs_give_alone(instructions, dimension, sides, monkeypatch):
    packing = spherocylinders(np.random.default_rng([18, dimension]), dimension)
    # Logarithms and powers, which two bonds need, are the library's for pairs alone.
    compare(monkeypatch, instructions, packing, sides, rounding=0.0 if sides == 1 else 1e-14)


@each_set
@pytest.mark.parametrize("dimension", [2, 3])
def test_packs_of_ellipsoids_give_what_pairs_give_alone(instructions, dimension, monkeypatch):
    """To rounding: in a pack with others two spheres are ellipsoids."""
    packing = superellipsoids(np.random.default_rng(dimension), dimension)
    compare(monkeypatch, instructions, packing, 1, rounding=1e-14)


@each_set
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("made", [spherocylinders, superellipsoids])
def test_packs_where_all_are_round_give_what_pairs_give_alone(
    instructions, made, dimension, monkeypatch
):
    """To the last bit, without torques; some pairs have the same centre."""
    packing = made(np.random.default_rng([6, dimension]), dimension)
    packing = replace(packing, diameters=np.repeat(packing.diameters[:, :1], 3, axis=1))
    compare(monkeypatch, instructions, packing, 1)
    assert sums(monkeypatch, instructions, packing, 1)["crossing"] >= 0


@each_set
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("p", [0.7, 0.9, 1.2, 1.5, 2.0, 2.3, 3.0])
def test_packs_of_superellipsoids_give_what_pairs_give_alone(
    instructions, p, dimension, monkeypatch
):
    """To what their iterations leave open: near faces a lever moves by the root of it."""
    packing = superellipsoids(np.random.default_rng([4, dimension]), dimension, p)
    compare(monkeypatch, instructions, packing, 1, rounding=1e-11)


POLYGONS = {
    "squares": {"rounding": 0.3},
    "triangles": {"corners": js.regular_polygon(3), "rounding": 0.4},
    "20 corners": {"corners": js.regular_polygon(20), "rounding": 0.5},
    "two corners": {"corners": "-0.5 0/0.5 0", "rounding": 0.5},
    "discs": {"corners": "0 0", "rounding": 0.5},
}


@each_set
@pytest.mark.parametrize("sides", [1, 2])
@pytest.mark.parametrize("name", POLYGONS)
def test_packs_of_polygons_give_what_pairs_give_alone(instructions, name, sides, monkeypatch):
    shape = js.Spheropolygons(**POLYGONS[name])
    packing = js.make_packing(shape, n=60, seed=1, u0=1e-6, progress=False)
    law = packing.law.but(sides=sides)
    packing = packing.with_(law=law, diameters=1.03 * packing.diameters)  # out of balance

    def gradient(which):
        monkeypatch.setenv("JAMSHAPE_SIMD", which)
        return Landscape(packing).evaluate(State.of(packing), extended=False)

    alone, found = gradient("scalar"), gradient(instructions)
    assert found.n_bonds == alone.n_bonds > 50
    atol = 1e-13 * np.abs(alone.gradient).max()
    np.testing.assert_allclose(found.gradient, alone.gradient, rtol=0.0, atol=atol)
    for sum_of in ("energy", "bond_force", "virial"):
        np.testing.assert_allclose(
            getattr(found, sum_of), getattr(alone, sum_of), rtol=1e-12, atol=1e-18
        )


@pytest.mark.skipif(len(PACKS) < 2, reason="one set of instructions")
@pytest.mark.parametrize("p", [0, 0.7, 1.5, 2.3])
def test_all_sets_round_alike(p, monkeypatch):
    """Packs of rods (p = 0) and superellipsoids do not depend on the machine."""
    rng = np.random.default_rng(5)
    packing = superellipsoids(rng, 3, p) if p else PairPacking.of(rng, every_kind(rng, 3))
    first, *others = [sums(monkeypatch, name, packing, 2) for name in PACKS]
    for found in others:
        np.testing.assert_array_equal(found["force"], first["force"])
        np.testing.assert_array_equal(found["torque"], first["torque"])


@each_set
@pytest.mark.parametrize("n", [1, 2, 3, 7, 8, 63, 64, 65, 129])
def test_packs_that_are_not_full_count_no_pair_twice(instructions, n, monkeypatch):
    rng = np.random.default_rng(n)
    packing = PairPacking.of(rng, disc_to_disc(rng, n, 2, overlaps(rng, n)))
    alone = sums(monkeypatch, "scalar", packing, 1)
    found = sums(monkeypatch, instructions, packing, 1)
    assert found["n_bonds"] == alone["n_bonds"] == n
    np.testing.assert_array_equal(found["force"], alone["force"])
    assert found["energy"] == pytest.approx(alone["energy"], rel=1e-14)


def test_a_set_that_this_machine_has_not_is_refused(monkeypatch):
    monkeypatch.setenv("JAMSHAPE_SIMD", "mmx")
    discs = rods(np.ones((2, 3)), 2)
    pose = np.zeros((2, 2, 2)), np.zeros((2, 2, 1)), np.stack([9 * np.eye(2), 0 * np.eye(2)])
    with pytest.raises(ValueError, match=r"JAMSHAPE_SIMD=mmx, expected no value or scalar"):
        discs.sums(*pose, np.array([[0, 1]]), np.zeros((1, 2), int), False)
