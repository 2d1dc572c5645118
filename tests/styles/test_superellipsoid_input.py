"""Wrong input to superellipsoid/harmonic stops with one sentence; exponents go to the types named."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_scenes import error_of, load_plugin, refusals, run_lmp
from superellipsoid_scenes import loaded, particles, scene, sums

pytestmark = pytest.mark.lammps

FOUND = "pair_coeff of superellipsoid/harmonic found "


def two(**changes):
    """Of two types, in contact."""
    fields = {"position": [[0.0, 0, 0], [0.9, 0.3, 0.2]], "orientation": [1.0, 0.2, 0.1, -0.3],
              "semi_axes": [0.5, 0.6, 0.8], "exponent": [1.0, 1.5], "edges": [9.0] * 3}  # fmt: skip
    return particles(**(fields | changes))


@pytest.fixture
def sentence_of(tmp_path):
    """The error of an input that follows the set-up of two particles, or of others."""

    def run(commands, packing=None, ranks=1):
        text = scene(packing or two(), tmp_path / "s.data")
        return error_of(run_lmp(f"{load_plugin()}\n{text}\n{commands}", tmp_path, ranks))

    return run


def test_pair_style_takes_no_arguments(sentence_of):
    assert sentence_of("pair_style superellipsoid/harmonic p 1.5") == (
        "pair_style superellipsoid/harmonic found 'p 1.5', expected no arguments: give exponents "
        "with 'pair_coeff I I epsilon p'."
    )


@pytest.mark.parametrize(("words", "number"), [("1 1", 2), ("1 1 1.0 1.5 2", 5)])
def test_pair_coeff_has_three_or_four_arguments(words, number, sentence_of):
    assert sentence_of(f"pair_coeff {words}") == (
        f"{FOUND}{number} arguments, expected 'I J epsilon' or 'I I epsilon p'."
    )


@pytest.mark.parametrize("value", ["0.0", "-1.0", "1e400"])
def test_epsilon_must_be_positive(value, sentence_of):
    expected = (
        f"{FOUND}epsilon = {value}, expected a positive energy: give the contacts a stiffness such "
        "as 1.0."
    )
    assert sentence_of(f"pair_coeff 1 1 {value}") in refusals(value, expected)


@pytest.mark.parametrize("value", ["0.5", "0.0", "-2", "1e400"])
def test_exponent_must_be_convex(value, sentence_of):
    expected = (
        f"{FOUND}p = {value}, expected a finite number above 0.5: particles of other exponents are "
        "not convex."
    )
    assert sentence_of(f"pair_coeff 1 1 1.0 {value}") in refusals(value, expected)


@pytest.mark.parametrize("value", ["round", "nan", "1,5"])
def test_what_is_not_a_number_is_named(value, sentence_of):
    """LAMMPS's own sentence."""
    assert sentence_of(f"pair_coeff 1 1 1.0 {value}") == (
        f"Expected floating point parameter instead of '{value}' in input script or data file"
    )


@pytest.mark.parametrize("types", ["1 2", "1 *", "* 2", "1*2 2"])
def test_exponents_belong_to_types(types, sentence_of):
    i, j = types.split()
    assert sentence_of(f"pair_coeff {types} 1.0 1.5") == (
        f"{FOUND}p = 1.5 for types {i} and {j}, expected p only for equal types: an exponent "
        "belongs to a type; give it with 'pair_coeff I I epsilon p'."
    )


@pytest.mark.parametrize(
    ("lines", "exponents"),
    [
        (["* * 1.0 2.0"], [2.0, 2.0]),
        (["1*2 1*2 1.0 0.75"], [0.75, 0.75]),
        (["* * 1.0 2.0", "2 2 1.0 0.9"], [2.0, 0.9]),
        (["1 1 1.0 3.0", "* * 1.0"], [3.0, 1.5]),
        (["1 1 1.0 3.0", "1 2 1.0", "2 2 1.0 1"], [3.0, 1.0]),
    ],
)
def test_lines_give_exponents_to_the_types_they_name(lines, exponents, tmp_path):
    """A line without p leaves the exponents as they were."""
    packing = two()
    with loaded(packing, tmp_path) as session:
        session.commands("\n".join(f"pair_coeff {line}" for line in lines) + "\nrun 0")
        energy = session.lmp.get_thermo("pe")
    expected = sums(packing.with_(exponent=np.array(exponents)), 1.0)["energy"]
    np.testing.assert_allclose(energy, expected, rtol=1e-12)


def test_exponent_is_1_unless_told(tmp_path):
    packing = two()
    text = scene(packing, tmp_path / "s.data").split("pair_style")[0]
    done = run_lmp(
        f"""{load_plugin()}
        {text}
        pair_style superellipsoid/harmonic
        pair_coeff * * 1.0
        thermo_modify norm no
        run 0
        print "energy $(pe:%.17g)" """,
        tmp_path,
    )
    energy = float(done.stdout.split("energy ")[-1].split()[0])
    np.testing.assert_allclose(
        energy, sums(packing.with_(exponent=np.ones(2)), 1.0)["energy"], rtol=1e-12
    )


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_coinciding_centres(exponent, ranks, sentence_of):
    found = sentence_of("run 0", two(position=[[1.0, 1, 1], [1.0, 1, 1]], exponent=exponent), ranks)
    assert found in {
        f"pair_style superellipsoid/harmonic found atoms {pair} with coinciding centres, where no "
        "contact force exists: start from a state without overlap, or use a smaller timestep."
        for pair in ("1 and 2", "2 and 1")
    }


def test_shapes_that_grow_behind_our_back_are_noticed(sentence_of):
    """By the corners of a box-like particle, not by its axes."""
    found = sentence_of(
        """neigh_modify every 1 delay 0 check no
        run 0
        set atom 2 shape 1.61 1.2 1.0
        run 1 pre no"""
    )
    assert found == (
        "pair_style superellipsoid/harmonic found atom 2 larger than at the start of the run, so "
        "the ghost cutoff is too short: do not use 'pre no' in the run after changing shapes."
    )
