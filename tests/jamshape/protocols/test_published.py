"""Protocols by their names: their numbers, what they refuse, and what their files tell."""

import math
from functools import cache

import numpy as np
import pytest
from making import made, stage_of, write_every_mark
from squeezed import quickly_squeezed

import jamshape as js
from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    write_packing,
    write_run,
)
from jamshape.landscape import Landscape, State
from jamshape.minima import Stop, minimise
from jamshape.minima.target import TargetError
from jamshape.protocols import approach, stages
from jamshape.protocols.approach import Approach, ApproachError
from jamshape.protocols.defaults import PROTOCOLS, recipe_for
from jamshape.protocols.make import make, require_same
from jamshape.protocols.recipe import Compressed, Dynamics, Recipe
from jamshape.shapes.particles import Particles

RODS = js.Spherocylinders(alpha=1)
BALLS = js.Superellipsoids(p=1.5)
U0 = 1e-8
# Of the frames of a run; nearer to each other where it jams, so that few steps of 1e-6 lead to U0.
STRAINS = (
    *np.arange(0, 0.033, 1e-3),
    *np.arange(0.033, 0.037, 1e-4),
    *np.arange(0.037, 0.06, 1e-3),
)


@cache
def frames():
    """A rod packing that is squeezed from well below jamming to well above."""
    packing, state = quickly_squeezed(16, 1, 0.86, 2)
    loose = state.strained(0.02).packing(packing)
    start = State.of(loose.with_(position=loose.position, orientation=loose.orientation))
    states = [start.strained(-strain) for strain in STRAINS]
    return [state.packing(packing).with_(step=k) for k, state in enumerate(states)]


@pytest.fixture
def run(tmp_path):
    """The file of a compression of rods through jamming."""
    return written(tmp_path / "through.h5", frames())


def written(path, states):
    told = dict(RODS.told) | {"n": 16, "seed": 3, "kappa": 1e-5, "finished": True}
    write_run(path, states, told)
    return path


def packed(out, **options):
    return js.make_packing(file=out, protocol="marschall-2018", u0=U0, progress=False, **options)


def test_numbers_are_short_for_names():
    for number, name in ((1, "yuan-2019-1"), (2, "yuan-2019-2")):
        short, full = (recipe_for(BALLS, protocol=which) for which in (number, name))
        assert short == full
        assert full.attributes()["protocol"] == name
    assert recipe_for(BALLS, protocol="steps") == recipe_for(BALLS, protocol="yuan-2019-1")
    assert recipe_for(BALLS, protocol=2).way.thermal.n_sweeps == 100_000


def test_names_give_the_published_numbers():
    ours = recipe_for(RODS, protocol="marschall-2018")
    assert (ours.n, ours.phi_start, ours.target.u0, ours.target.accuracy) == (
        1024,
        0.4,
        1e-15,
        1e-7,
    )
    assert ours.way == Compressed(kappa=1e-6, phi_end=0.95, search="extrapolation")
    published = recipe_for(
        RODS, protocol="marschall-2018", search="bisection", minimiser="cg_marschall"
    )
    assert (published.target.step, published.target.method) == (1e-6, "cg_marschall")
    yuan = recipe_for(BALLS, protocol="yuan-2019-1")
    steps = yuan.way.quasistatic
    assert (yuan.n, steps.step, steps.tolerance, steps.energy) == (400, 1e-3, 1e-4, 1e-10)
    assert recipe_for(BALLS, protocol="yuan-2019-2").way.thermal.phi == 0.55
    assert recipe_for(RODS, protocol="marschall-2018", n=32, kappa=1e-5).way.kappa == 1e-5


REFUSED = {
    "p_end does not apply to the protocol marschall-2018": {"protocol": "marschall-2018", "p_end": 1e-3},
    "n_sweeps does not apply to the protocol yuan-2019-1": {"protocol": 1, "n_sweeps": 5},
    "kappa does not apply to the protocol yuan-2019-2": {"protocol": 2, "kappa": 1e-6},
    "start does not apply to the protocol dynamics": {"protocol": "dynamics", "search": None, "start": "a.h5"},
    "protocol is 'yuan', expected one of quasistatic, dynamics, steps, marschall-2018": {"protocol": "yuan"},
    "protocol is True, expected one of": {"protocol": True},
    "search is 'blind', expected one of extrapolation, bisection": {"protocol": "marschall-2018", "search": "blind"},
    "minimiser is 'none', expected one of": {
        "protocol": "marschall-2018", "search": "bisection", "minimiser": "none",
    },
    "minimiser='cg_marschall' has no effect with the search extrapolation": {
        "protocol": "marschall-2018", "minimiser": "cg_marschall",
    },
    "u0=0 does not work with the protocol": {"protocol": "marschall-2018", "u0": 0.0},
    "kappa is 1e-12, expected at least 1e-10": {"protocol": "marschall-2018", "kappa": 1e-12},
    "phi_start is 0.97 and phi_end 0.95": {"protocol": "marschall-2018", "phi_start": 0.97},
}  # fmt: skip


@pytest.mark.parametrize("words", REFUSED)
def test_what_is_none_of_a_protocol_is_refused(words, run, monkeypatch):
    monkeypatch.chdir(run.parent)
    write_packing("a.h5", frames()[0])
    with pytest.raises(ValueError, match=r"expected|leave") as error:
        recipe_for(RODS, **REFUSED[words]) if "start" not in REFUSED[words] else recipe_for(
            **REFUSED[words]
        )
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_files_of_protocols_are_those_of_their_numbers(tmp_path):
    recipe = recipe_for(RODS, protocol="steps", n=16)
    known = recipe.attributes() | {"outcome": "converged"}
    out, sizes = tmp_path / "packing.h5", recipe.particles.sample(16, np.random.default_rng(1))
    write_packing(out, frames()[0].with_(diameters=sizes.diameters), known)
    assert read_attributes(out)["protocol"] == "yuan-2019-1"
    require_same(out, recipe)
    require_same(out, recipe_for(RODS, protocol=1, n=16))
    with pytest.raises(ValueError, match="protocol = yuan-2019-1, expected yuan-2019-2"):
        require_same(out, recipe_for(RODS, protocol=2, n=16, phi_thermal=0.5))


def u_of(packing):
    """Energy density of a frame once forces balance, or below U0."""
    stop = Stop(1e-4, lowest=U0)
    return minimise(Landscape(packing), State.of(packing), "auto", stop).energy_density


def test_a_start_is_taken_where_it_is_first_jammed(run, tmp_path):
    found = packed(tmp_path / "packing.h5", start=run)
    told = found.results
    step = told["start_step"]
    assert u_of(frames()[step - 1]) <= U0 < u_of(frames()[step])
    assert (told["protocol"], told["search"], told["start"]) == (
        "marschall-2018",
        "extrapolation",
        run.name,
    )
    assert told["start_phi"] == pytest.approx(frames()[step].phi, rel=1e-14)
    assert told["start_u_minimised"] == pytest.approx(u_of(frames()[step]), rel=1e-12)
    assert told["start_u"] > told["start_u_minimised"]
    assert (told["n"], told["seed"], told["alpha"], told["kappa"]) == (16, 3, 1.0, 1e-5)
    assert told["u"] == pytest.approx(U0, rel=1e-7)
    assert told["search_evaluations"] == told["evaluations"] > 0
    # It is the file's own particles, in its order, and is loaded when asked for again.
    np.testing.assert_array_equal(found.diameters, frames()[0].diameters)
    again = packed(tmp_path / "packing.h5", start=run)
    np.testing.assert_array_equal(again.position, found.position)
    assert {path.name for path in tmp_path.iterdir()} == {"packing.h5", run.name}


def test_both_searches_end_at_one_packing(run, tmp_path):
    ours = packed(tmp_path / "extrapolation.h5", start=run)
    papers = packed(tmp_path / "bisection.h5", start=run, search="bisection")
    assert papers.results["search"] == "bisection"
    assert papers.results["search_minimisations"] > 40
    assert papers.u == pytest.approx(U0, rel=1e-7)
    assert papers.results["phi_J"] == pytest.approx(ours.results["phi_J"], abs=1e-6)
    assert papers.z == ours.z
    with pytest.raises(ValueError, match="search = bisection, expected extrapolation"):
        packed(tmp_path / "bisection.h5", start=run)


def test_a_halving_search_that_was_killed_goes_on_to_the_same_bits(run, tmp_path, monkeypatch):
    recipe = recipe_for(protocol="marschall-2018", start=run, search="bisection", u0=U0)
    whole, cut = tmp_path / "whole.h5", tmp_path / "cut.h5"
    steps = made(recipe, whole)
    write_every_mark(monkeypatch)
    searched = [at for at in steps if stage_of(at) == "search"]
    # Before u crosses u0, and while lambda is halved.
    made(recipe, cut, len(steps) - len(searched) + 20)
    made(recipe, cut, len(searched) - 40)
    monkeypatch.undo()
    rest = made(recipe, cut)
    assert len(rest) == 20
    assert rest[-1].text == searched[-1].text
    for one, other in zip(read_packing(cut).poses(), read_packing(whole).poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    names = ("evaluations", "search_minimisations", "start_step", "start_evaluations", "u", "phi")
    mine, others = read_attributes(cut), read_attributes(whole)
    assert [mine[name] for name in names] == [others[name] for name in names]


def test_progress_says_how_many_steps_are_left(run, tmp_path):
    recipe = recipe_for(protocol="marschall-2018", start=run, search="bisection", u0=U0)
    steps = made(recipe, tmp_path / "a.h5")
    texts = [at.text for at in steps if stage_of(at) == "search"]
    first = next(k for k, text in enumerate(texts) if "more of it" in text)
    left = int(texts[first].split("about ")[1].split()[0])
    crossed = next(k for k, text in enumerate(texts) if "step 5.0e-07" in text)
    assert left == pytest.approx(crossed - first, rel=0.2)


def test_a_search_ends_after_so_many_minimisations(run, tmp_path, monkeypatch):
    monkeypatch.setattr(stages, "MOST_MINIMISATIONS", 5)
    with pytest.raises(
        TargetError, match=r"after 5 minimisations the search is at u = .* expected u"
    ):
        packed(tmp_path / "a.h5", start=run, search="bisection")
    monkeypatch.undo()
    assert (
        packed(tmp_path / "a.h5", start=run, search="bisection").results["outcome"] == "converged"
    )


OTHERS = {
    "n=32 differs from 16 of start=": {"n": 32},
    "seed=4 differs from 3 of start=": {"seed": 4},
    "dimension=3 differs from 2 of start=": {"dimension": 3},
    "kappa=1e-06 has no effect on a start": {"kappa": 1e-6},
    "phi_end=0.9 has no effect on a start": {"phi_end": 0.9},
    "phi_start=0.3 has no effect on a start": {"phi_start": 0.3},
    "requested, Particles('spherocylinder', alpha=4": {"particles": js.Spherocylinders(alpha=4)},
    "requested, Particles('dimer'": {"particles": js.Dimers(alpha=1)},
}


@pytest.mark.parametrize("words", OTHERS)
def test_what_contradicts_a_start_is_refused(run, tmp_path, words):
    with pytest.raises(ValueError, match="leave") as error:
        packed(tmp_path / "a.h5", start=run, **OTHERS[words])
    assert words in str(error.value)
    assert not (tmp_path / "a.h5").exists()


def test_what_agrees_with_a_start_is_taken(run):
    asked = recipe_for(RODS, protocol="marschall-2018", start=run, n=16, seed=3, dimension=2)
    assert asked.attributes() == recipe_for(protocol="marschall-2018", start=run).attributes()


def test_a_start_below_jamming_is_refused(tmp_path):
    run = written(tmp_path / "below.h5", frames()[:10])
    with pytest.raises(ValueError, match=r"last frame, at phi = .* expected more than u0 = 1e-08"):
        packed(tmp_path / "a.h5", start=run)


def test_neither_particles_nor_a_start_are_refused():
    with pytest.raises(ValueError, match="neither particles nor a start"):
        recipe_for(protocol="marschall-2018")


@pytest.mark.lammps
def test_a_compression_through_jamming_is_not_opened(tmp_path):
    out = tmp_path / "packing.h5"
    quick = {"n": 16, "phi_start": 0.6, "kappa": 1e-4}
    told = packed(out, particles=RODS, **quick).results
    rows = read_observables(tmp_path / "packing.h5.run.h5")
    assert (np.diff(rows["phi"]) > 0).all()
    assert told["compression_phi"] == pytest.approx(0.95, rel=1e-9)
    for name in ("phi", "u", "pressure", "evaluations"):
        assert told[f"compression_{name}"] == rows[name][-1]
    assert told["start_file"] == "packing.h5.run.h5"
    assert told["phi"] < told["start_phi"] < told["compression_phi"]
    assert not math.isnan(told["phi_J"])
    assert list(tmp_path.glob("*restart*")) == []
    # The run is there to be searched from, too: it leads to the same packing.
    out.unlink()
    packed(out, particles=RODS, **quick)
    other = packed(tmp_path / "other.h5", start=tmp_path / "packing.h5.run.h5")
    np.testing.assert_array_equal(other.position, read_packing(out).position)
    with pytest.raises(ValueError, match=r"kappa = 0.0001, expected 1e-05"):
        packed(out, particles=RODS, **quick | {"kappa": 1e-5})


@pytest.mark.lammps
def test_an_approach_to_jamming_ends_after_so_many_steps(tmp_path, monkeypatch):
    monkeypatch.setattr(approach, "MOST_STEPS", 1000)
    recipe = Recipe(Particles.of(alpha=0.0), n=16, way=Dynamics(Approach(kappa=1e-6)))
    with pytest.raises(ApproachError, match=r"1e.03 time steps phi = 0.* expected 0.001"):
        make(recipe, tmp_path / "a.h5")


def test_a_rate_whose_approach_would_not_end_is_refused():
    with pytest.raises(ValueError, match=r"kappa is 1e-14, expected at least 4e-12.*jamshape slow"):
        recipe_for(RODS, protocol="dynamics", kappa=1e-14)


def test_every_protocol_has_its_defaults_in_both_dimensions():
    stored = {"dynamics": None, "steps": "yuan-2019-1"}  # by its settings; alike the published one
    for name in PROTOCOLS:
        for dimension in (2, 3):
            recipe = recipe_for(RODS, protocol=name, dimension=dimension)
            assert recipe.attributes().get("protocol") == stored.get(name, name)
