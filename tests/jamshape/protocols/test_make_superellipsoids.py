import numpy as np
import pytest
from making import made, stages_of, write_every_mark
from mixtures import superellipsoids

from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_attributes, read_observables, read_packing, read_report
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import summary_of
from jamshape.minima import residual_of
from jamshape.minima.target import Target, find
from jamshape.protocols.make import Recipe, Steps, Thermalisation, make, require_same
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.vibration.hessian import dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.statistics import bands, count, why_no_bands

COARSE = Steps(Quasistatic(step=1e-2))


def recipe(target=None, way=COARSE, seed=1, **shape):
    return Recipe(superellipsoids(**shape), 24, 3, seed, phi_start=0.4, way=way, target=target)


TIGHT = Target(1e-12)
RECIPES = {
    "spheres": recipe(TIGHT, seed=3),  # equal spheres may order, and then have more contacts
    "spheroids": recipe(TIGHT, w1=0.7),
    "general ellipsoids": recipe(TIGHT, w1=0.8, w2=1.25),
    "boxes": recipe(TIGHT, p=1.5),
    "octahedra": recipe(TIGHT, p=0.85),
}
FREEDOM = {"spheres": 3, "spheroids": 5}


@pytest.fixture(scope="module")
def packings(tmp_path_factory):
    folder, made = tmp_path_factory.mktemp("superellipsoids"), {}

    def get(name):
        if name not in made:
            made[name] = folder / f"{name}.h5"
            make(RECIPES[name], made[name])
        return made[name]

    return get


@pytest.mark.parametrize("name", RECIPES)
def test_a_packing_is_at_its_energy_and_in_balance(packings, name):
    packing, stored = read_packing(packings(name)), read_attributes(packings(name))
    landscape, state = Landscape(packing), State.of(packing)
    found = landscape.evaluate(state)
    assert found.energy / state.volume == pytest.approx(1e-12, rel=1e-7)
    assert residual_of(landscape, found).largest < 1e-8
    assert stored["phi"] == pytest.approx(packing.phi, rel=1e-14)
    assert 0.5 < stored["phi_J"] < stored["phi"] < 0.78
    network = find_contacts(packing)
    held = ~np.isin(packing.id[network.pairs], stored_rattlers(packings(name))).any(axis=1)
    assert stored["n_contacts"] == held.sum()
    assert summary_of(packings(name))["reached"]
    assert len(read_report(packings(name)).error) > 10


def stored_rattlers(path):
    return read_observables(path)["rattler_ids"][-1]


@pytest.mark.parametrize("name", RECIPES)
def test_missing_contacts_are_quartic_modes(packings, name):
    # N_c = d_f (N - N_r) - 2 - N_q (Yuan et al. 2019, Sec. 3.2), that is rank(H) = N_c - 1.
    packing = read_packing(packings(name))
    matrix = dynamical_matrix(Landscape(packing), State.of(packing))
    found = spectrum(matrix)
    counts = count(matrix, found)
    assert counts.rank == counts.n_bonds - 1
    d_f = FREEDOM.get(name, 6)
    assert matrix.size == d_f * matrix.n_particles
    assert read_attributes(packings(name))["z_iso"] == 2 * d_f
    n_quartic = sum(band.n_modes for band in bands(matrix, found) if band.name != "high")
    if why_no_bands(matrix, found):  # no gap of a factor of three: by rank alone
        n_quartic = counts.n_floppy
    assert matrix.n_bonds == d_f * matrix.n_particles - 2 - n_quartic
    assert (n_quartic == 0) == (name == "spheres")
    assert (found.sign[~found.is_translation] > 0).all()  # a minimum, to second order too


def test_protocol_1_ends_just_above_the_jamming_that_the_direct_search_finds(tmp_path):
    sample = recipe(w1=0.7)
    make(sample, tmp_path / "bisected.h5")
    packing, bisected = (read(tmp_path / "bisected.h5") for read in (read_packing, read_attributes))
    assert 1e-10 < bisected["energy_per_particle"] <= 2e-10
    assert bisected["residual_force"] <= 1e-4
    landscape = Landscape(packing)
    found = find(landscape, State.of(packing), Target(1e-14))
    phi = found.state.packing(packing).phi
    assert bisected["phi_J"] == pytest.approx(phi, abs=1e-6)
    assert bisected["phi"] - phi > 5e-6


def test_protocol_2_thermalises_and_goes_on_from_where_it_was(tmp_path, monkeypatch):
    way = Steps(COARSE.quasistatic, Thermalisation(0.4, 200))
    sample = Recipe(superellipsoids(1.5), 16, 3, phi_start=0.3, way=way, target=Target(1e-10))
    stages = stages_of(sample, tmp_path / "whole.h5")
    first, last = stages.index("Monte Carlo"), len(stages) - stages[::-1].index("Monte Carlo")
    assert set(stages[:first]) == set(stages[last:]) - {"search"} == {"compression"}
    write_every_mark(monkeypatch)
    *_, at = made(sample, tmp_path / "cut.h5", first + 8)
    monkeypatch.undo()
    assert at.part == 80 / 200
    assert "sweep 80 of 200, acceptance 0." in at.text
    assert len(stages_of(sample, tmp_path / "cut.h5")) == len(stages) - first - 8
    one, other = (read_packing(tmp_path / f"{name}.h5") for name in ("whole", "cut"))
    np.testing.assert_array_equal(one.position, other.position)
    np.testing.assert_array_equal(one.orientation, other.orientation)
    one, other = (read_attributes(tmp_path / f"{name}.h5") for name in ("whole", "cut"))
    assert one["acceptance"] == other["acceptance"] > 0
    assert {path.name for path in tmp_path.iterdir()} == {"whole.h5", "cut.h5"}


def test_another_sample_is_refused(tmp_path, packings, monkeypatch):
    with pytest.raises(ValueError, match=r"a packing with w1 = 0\.7, expected 1"):
        require_same(packings("spheroids"), RECIPES["spheres"])
    write_every_mark(monkeypatch)
    out = tmp_path / "packing.h5"
    made(RECIPES["boxes"], out, 1)
    with pytest.raises(ValueError, match=r"holds a packing with exponent=1\.5, expected 0\.85"):
        make(RECIPES["octahedra"], out)
    made(RECIPES["octahedra"], out, 1, again=True)


@pytest.mark.parametrize(
    ("numbers", "sentence"),
    [
        ({"n": 0}, "n is 0, expected a whole number of particles from 1"),
        ({"dimension": 4}, "dimension is 4, expected 2 or 3"),
        ({"phi_start": 1.5}, "phi_start is 1.5, expected a packing fraction from"),
        ({"target": None}, "u0=0 does not work with the protocol dy"),
    ],
)
def test_senseless_recipes_are_refused(numbers, sentence):
    with pytest.raises(ValueError, match=sentence):
        Recipe(**numbers)


def test_senseless_monte_carlo_is_refused():
    with pytest.raises(ValueError, match="expected a start at a smaller packing fraction"):
        Recipe(way=Steps(thermal=Thermalisation(0.3)), phi_start=0.3)
    with pytest.raises(ValueError, match=r"phi_thermal is .*, expected a packing fraction from"):
        Thermalisation(1.5)


@pytest.mark.parametrize(("p", "w1", "w2"), [(0.5, 1, 1), (1, 1.5, 1), (1, 1, 0.5)])
def test_senseless_shapes_are_refused(p, w1, w2):
    with pytest.raises(ValueError, match="expected"):
        superellipsoids(p, w1, w2)
