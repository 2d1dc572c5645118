import json

import pytest
from mixtures import bidisperse, superellipsoids

from common.averages import averages
from common.ensembles import (
    Choice,
    choose,
    conditions,
    curves_over,
    finished,
    n_of,
    of_paper,
    one_curve,
    read_groups,
)
from common.text import conditions_text, system_labels
from jamshape.command import plain
from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import write_packing
from jamshape.protocols.random_start import random_packing

ROD, OTHER = "spherocylinder", "superellipsoid"


def write(folder, name, particles, dimension=2, **attributes):
    """A finished packing as make_packing.py writes it, whatever state it is in."""
    packing = random_packing(8, 0.1, 1, particles, dimension)
    known = dict(particles.told) | {"n": 8, "seed": 1, "outcome": "converged"} | attributes
    path = folder / f"{name}.h5"
    write_packing(path, packing, known)
    return path


@pytest.fixture
def folder(tmp_path):
    write(tmp_path, "a", bidisperse(4), seed=2, u0=1e-15)
    write(tmp_path, "b", bidisperse(4), seed=1, u0=1e-15)
    write(tmp_path, "c", bidisperse(0), u0=1e-15)
    write(tmp_path, "d", bidisperse(4), dimension=3, u0=1e-15)
    write(tmp_path, "stalled", bidisperse(1), outcome="stalled", u0=1e-15)
    write_packing(tmp_path / "start.h5", random_packing(8, 0.1, 1, bidisperse(1)))
    write_packing(tmp_path / "a.h5.run.h5", random_packing(8, 0.1, 1, bidisperse(1)))
    (tmp_path / "b.making.h5").write_text("still written")
    (tmp_path / "modes.h5").write_bytes(b"\x89HDF\r\n\x1a\n of another kind")
    return tmp_path


def test_packings_are_grouped_by_what_they_are_samples_of(folder):
    groups = read_groups([folder], needs=["alpha"], same=("n", "size_ratio", "u0"))
    assert list(groups) == [
        System(ROD, 2, (("alpha", 0.0),)),
        System(ROD, 2, (("alpha", 1.0),)),
        System(ROD, 2, (("alpha", 4.0),)),
        System(ROD, 3, (("alpha", 4.0),)),
    ]
    seeds = [[file.number("seed") for file in of] for of in groups.values()]
    assert seeds == [[1], [1], [1, 2], [1]]
    assert n_of(groups) == 8
    assert conditions(groups) == {"n": 8, "size_ratio": 1.4, "u0": 1e-15, "not_reached": 1}
    assert [of_paper(system) for system in groups] == [True, True, True, False]


def test_averages_are_given_with_and_without_what_did_not_reach_its_goal(tmp_path):
    write(tmp_path, "a", bidisperse(4), seed=1, z=5.9)
    write(tmp_path, "b", bidisperse(4), seed=2, z=5.7)
    write(tmp_path, "c", bidisperse(4), seed=3, z=5.5, outcome="sliding", residual=1e-6)
    write(tmp_path, "d", bidisperse(0), seed=1, z=4.0)
    groups = read_groups([tmp_path])
    discs, rods = averages(groups, "z").values()
    assert (rods.value, rods.samples) == (pytest.approx(5.7), 3)
    assert (rods.reached.value, rods.reached.samples) == (pytest.approx(5.8), 2)
    assert discs.reached is None
    assert "with 1 of 4 packings not at rest" in conditions_text(groups)
    told = plain(rods)
    assert (told["samples"], told["reached"]["samples"]) == (3, 2)


def test_shapes_with_other_parameters_and_protocols(tmp_path):
    one = superellipsoids(1.5, 0.8, 1.2)
    write(tmp_path, "a", one, dimension=3, protocol="yuan-2019-1")
    write(tmp_path, "b", one, dimension=3, protocol="yuan-2019-2", n_sweeps=50)
    first, second = read_groups([tmp_path], needs=("exponent", "w1"))
    assert (first.protocol, second.protocol, second.n_sweeps) == ("yuan-2019-1", "yuan-2019-2", 50)
    assert (first.number("exponent"), first.number("w2")) == (1.5, 1.2)
    told = json.loads(json.dumps(plain(second.report())))
    assert told == {
        "shape": OTHER,
        "dimension": 3,
        "exponent": 1.5,
        "w1": 0.8,
        "w2": 1.2,
        "protocol": "yuan-2019-2",
        "n_sweeps": 50,
    }
    assert not of_paper(first)


def test_ways_to_jamming_are_told_apart(tmp_path):
    """Packings of dynamics tell no protocol."""
    write(tmp_path, "a", bidisperse(1), seed=1)
    write(tmp_path, "b", bidisperse(1), seed=2, protocol="quasistatic")
    first, second = read_groups([tmp_path])
    assert (first.protocol, second.protocol) == ("", "quasistatic")
    assert of_paper(first)
    assert of_paper(second)
    assert system_labels([first, second])[first].endswith(", dynamics")
    assert system_labels([first, second])[second].endswith(", quasistatic")


def test_laws_of_contacts_are_told_apart(tmp_path):
    write(tmp_path, "a", bidisperse(1), seed=1)
    write(tmp_path, "b", bidisperse(1).under("hertz"), seed=1)
    first, second = read_groups([tmp_path])
    assert (first.law, second.law) == ("", "hertz")
    assert first._replace(law="hertz") == second
    assert not of_paper(second)
    assert second.report()["law"] == "hertz"
    assert system_labels([first, second])[second] == system_labels([first])[first] + ", hertz"


def test_a_mixture_is_named_by_its_kinds(tmp_path):
    packing = random_packing(8, 0.1, 1, bidisperse(1))
    known = {"kinds": "alpha=4,size=1; alpha=0,size=2", "n": 8, "seed": 1, "outcome": "converged"}
    write_packing(tmp_path / "m.h5", packing, known)
    (system,) = read_groups([tmp_path])
    assert system == System(ROD, 2, (), known["kinds"])
    assert not of_paper(system)


def test_curves_are_of_systems_that_differ_in_nothing_else(folder):
    groups = read_groups([folder])
    plane, space = curves_over(groups, "alpha").values()
    assert ([*plane], [*space]) == ([0.0, 1.0, 4.0], [4.0])
    with pytest.raises(ValueError, match="expected systems that differ in alpha only"):
        one_curve(groups, "alpha")
    system, curve = one_curve({s: of for s, of in groups.items() if s.dimension == 2}, "alpha")
    assert (system, [*curve]) == (System(ROD, 2, ()), [0, 1, 4])


def test_choice_of_systems(folder):
    groups = read_groups([folder])

    def chosen(*which):
        return [system.number("alpha") for system in choose(groups, "alpha", Choice(*which))]

    assert chosen([0.0], [4.0], 1) == [0.0]
    assert chosen([], [4.0, 7.0], 1) == [4.0, 4.0]
    assert chosen([], [7.0], 2) == [0.0, 4.0]
    with pytest.raises(ValueError, match=r"no packing has alpha = 7, expected one of 0, 1, 4"):
        chosen([7.0], [], 1)


def test_what_is_not_there_or_not_alike_is_said(folder, tmp_path):
    with pytest.raises(ValueError, match="has no number 'exponent', expected a packing"):
        read_groups([folder], needs=["exponent"])
    other = write(tmp_path, "other", bidisperse(1), u0=1e-12)
    with pytest.raises(ValueError, match="u0 is 1e-15 and 1e-12, expected one ensemble"):
        read_groups([folder, other], same=["u0"])
    (tmp_path / "nothing").mkdir()
    with pytest.raises(ValueError, match=r"no finished packing, expected files of sweep\.py"):
        finished([tmp_path / "nothing"])
    with pytest.raises(ValueError, match="has no attribute 'outcome'"):
        finished([folder / "start.h5"])
    with pytest.raises(FileNotFoundError):
        finished([folder / "none"])


def test_contacts_take_the_rattlers_that_a_file_tells(tmp_path):
    packing = random_packing(8, 0.5, 1, bidisperse(1))
    for name, told in (("a", {}), ("b", {"rattler_ids": [3.0]})):
        write_packing(tmp_path / f"{name}.h5", packing, {"outcome": "converged"}, told)
    found, told = (PackingFile.read(tmp_path / f"{name}.h5").contacts() for name in "ab")
    assert found.rattlers.all()
    assert told.packing.id[told.rattlers].tolist() == [3]
