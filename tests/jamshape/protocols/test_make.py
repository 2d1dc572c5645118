import math
from dataclasses import replace
from functools import cache

import h5py
import numpy as np
import pytest
from making import made, stage_of, write_every_mark
from mixtures import bidisperse, monodisperse
from squeezed import quickly_squeezed
from written import FINISHED, write_columns

import jamshape as js
from jamshape.contacts import coordination, find_contacts, find_rattlers, sum_forces
from jamshape.files.content import add_attributes
from jamshape.files.h5md import (
    read_attributes,
    read_observables,
    read_packing,
    read_report,
    write_packing,
)
from jamshape.landscape import Landscape, State
from jamshape.measures.packing_summary import measure, summary_of, write_minimum
from jamshape.minima import residual_of
from jamshape.minima.target import Search, Target, find
from jamshape.protocols import approach, stages
from jamshape.protocols.approach import Approach
from jamshape.protocols.make import Dynamics, Recipe, is_done, make, require_same
from jamshape.protocols.random_start import InsertionError, random_packing
from jamshape.shapes.shape import Interaction

U0 = 1e-12
RECIPE = Recipe(bidisperse(1.0), n=16, phi_start=0.5, target=Target(U0))
FAST = Dynamics(Approach(kappa=1e-5, p_end=3e-3, strain=2e-4))


def run_of(out):
    return out.with_name(out.name + ".run.h5")


def making_of(out):
    return out.with_name(out.name + ".making.h5")


@cache
def start():
    """A packing of rods just below jamming, in doubles."""
    packing, state = quickly_squeezed(16, 1, 0.86)
    return state.packing(packing).with_(position=state.packing(packing).position, step=3)


@cache
def minimum():
    landscape = Landscape(start())
    return landscape, find(landscape, State.of(start()), Target(U0))


def compressed(out, packing=None):
    """Write the files of a finished compression."""
    phi = np.linspace(0.80, 0.88, 60)
    p = 0.3 * np.clip(phi - 0.85, 0, None)
    kappa = np.where(np.arange(60) < 50, 1e-6, -1e-6)
    rows = {"phi": phi, "pressure": p, "kappa": kappa}
    write_columns(run_of(out), packing or start(), RECIPE.attributes() | FINISHED, rows)


def assert_same_result(out, expected):
    for one, other in zip(read_packing(out).poses(), read_packing(expected).poses(), strict=True):
        np.testing.assert_array_equal(one, other)
    mine, others = read_attributes(out), read_attributes(expected)
    for name in ("u", "pressure", "phi", "phi_J", "outcome", "residual", "n_contacts"):
        assert mine.get(name) == others.get(name), name


def test_file_of_a_minimum_holds_what_was_measured(tmp_path):
    landscape, found = minimum()
    out = tmp_path / "packing.h5"
    write_minimum(out, landscape, found, {"alpha": 1.0, "note": "as given"})
    attributes, observables = measure(landscape, found)
    stored = read_attributes(out)
    assert stored == attributes | {"alpha": 1.0, "note": "as given"}
    read = read_observables(out)
    assert read.keys() == observables.keys() >= {"rattler_ids", "net_force", "net_torque"}
    for name, value in observables.items():
        np.testing.assert_array_equal(read[name][0], value)
    state = State.of(read_packing(out))
    for name in ("position", "orientation", "edges"):
        np.testing.assert_array_equal(getattr(state, name), getattr(found.state, name))
    # Who reads the file finds the same energy, to the accuracy of an overlap of 1e-6.
    again = Landscape(read_packing(out)).evaluate(state)
    assert again.energy == pytest.approx(found.evaluation.energy, rel=1e-12)
    assert residual_of(landscape, again).largest <= 2e-8
    report = read_report(out)
    assert len(report.step) == min(len(found.history.residual), 2000)
    assert report.error[-1] == found.history.residual[-1]


def test_measured_numbers_are_those_of_the_contacts():
    landscape, found = minimum()
    attributes, observables = measure(landscape, found)
    packing = found.state.packing(landscape.particles)
    network = find_contacts(packing, 1.0, 2)
    forces = sum_forces(packing, network)
    assert attributes["u"] == pytest.approx(U0, rel=1e-7, abs=0)
    # Doubles have an overlap of 1e-6 to nine digits.
    assert attributes["u"] == pytest.approx(forces.energy / packing.box.volume, rel=1e-6, abs=0)
    assert attributes["pressure"] == pytest.approx(forces.pressure, rel=1e-6, abs=0)
    assert attributes["phi"] == packing.phi
    counts = coordination(packing, network)
    assert {k: attributes[k] for k in counts._fields} == counts._asdict()
    rattlers = packing.id[find_rattlers(packing, network)]
    np.testing.assert_array_equal(observables["rattler_ids"], rattlers)
    largest = max(attributes["residual_force"], attributes["residual_torque"])
    assert largest <= attributes["residual"] <= 1e-8
    assert attributes["outcome"] == "converged"


def test_jamming_density_is_where_the_energy_vanishes():
    landscape, found = minimum()
    phi_J = measure(landscape, found).attributes["phi_J"]
    finer = find(landscape, State.of(start()), Target(1e-16))
    phi = finer.state.packing(landscape.particles).phi
    assert phi_J == pytest.approx(phi, abs=1e-6)
    assert phi_J < found.state.packing(landscape.particles).phi


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    out = tmp_path_factory.mktemp("whole") / "packing.h5"
    compressed(out)
    return out, made(RECIPE, out)


def test_a_compression_that_is_there_is_taken_and_searched_from(whole):
    out, progress = whole
    assert {stage_of(at) for at in progress} == {"search"}
    assert is_done(out)
    assert read_attributes(run_of(out))["finished"]
    assert not making_of(out).exists()
    assert f"u {U0:.2e}, u/u0 1, " in progress[-1].text
    found, stored = summary_of(out), read_attributes(out)
    assert found["reached"] is True
    assert found["u"] == stored["u"] == pytest.approx(U0, rel=1e-7, abs=0)
    assert f"phi {found['phi']:.6f}, " in progress[-1].text
    identity = {"n": 16, "alpha": 1.0, "seed": 1, "phi_start": 0.5, "u0": U0, "size_ratio": 1.4}
    assert {name: stored[name] for name in identity} == identity
    assert stored["phi_J_compression"] == pytest.approx(0.85, abs=1e-3)
    assert stored["evaluations"] > 10
    assert stored["wall_seconds"] > 0


@pytest.mark.parametrize("after", [1, 4])
def test_a_search_that_was_killed_goes_on_to_the_same_bits(whole, tmp_path, monkeypatch, after):
    write_every_mark(monkeypatch)
    out = tmp_path / "packing.h5"
    compressed(out)
    assert len(whole[1]) > after + 1
    for _ in range(2):  # twice, further on the second time
        last = made(RECIPE, out, after)[-1]
        assert making_of(out).exists()
    rest = made(RECIPE, out)
    assert last == whole[1][2 * after - 1]
    assert len(rest) == len(whole[1]) - 2 * after
    assert_same_result(out, whole[0])
    assert not making_of(out).exists()


def test_a_search_from_a_start_without_contacts_goes_on_to_the_same_bits(tmp_path, monkeypatch):
    # Its first state is all doubles, those after it are not.
    packing, state = quickly_squeezed(16, 1, 0.86)
    apart = state.strained(0.006).packing(packing)
    apart = apart.with_(position=apart.position, orientation=apart.orientation, box=apart.box)
    assert not len(find_contacts(apart, 1.0, 2).pairs)
    unbroken, out = tmp_path / "unbroken.h5", tmp_path / "packing.h5"
    for path in (unbroken, out):
        compressed(path, apart)
    make(RECIPE, unbroken)
    with monkeypatch.context() as patch:
        write_every_mark(patch)
        made(RECIPE, out, 1)
    make(RECIPE, out)
    assert_same_result(out, unbroken)


def test_the_search_of_another_target_is_not_gone_on_with(tmp_path, monkeypatch):
    write_every_mark(monkeypatch)
    out = tmp_path / "packing.h5"
    compressed(out)
    made(RECIPE, out, 3)
    other = replace(RECIPE, target=Target(1e-8))
    with pytest.raises(ValueError, match=r"holds a packing with u0=1e-12, expected 1e-08; choose"):
        make(other, out)
    made(other, out, again=True)
    assert read_attributes(out)["u"] == pytest.approx(1e-8, rel=1e-7, abs=0)


OTHERS = {
    "alpha = 1.0, expected 0.5": {"particles": bidisperse(0.5)},
    "n = 16, expected 24": {"n": 24},
    "seed = 1, expected 9": {"seed": 9},
    "approach_kappa = 1e-07, expected 1e-05": {"way": FAST},
    "size_ratio = 1.4, expected 1.0": {"particles": monodisperse(1.0)},
}


def refused(sample, out):
    """Return why a sample is not made, and check that its files stay as they are."""
    before = {path: path.read_bytes() for path in out.parent.iterdir()}
    with pytest.raises(ValueError) as error:
        make(sample, out)
    assert {path: path.read_bytes() for path in out.parent.iterdir()} == before
    sentence = str(error.value)
    assert "\n" not in sentence
    assert sentence.startswith(str(out))
    return sentence


@pytest.mark.parametrize("words", OTHERS)
def test_the_compression_of_another_sample_is_neither_taken_nor_replaced(tmp_path, words):
    out = tmp_path / "packing.h5"
    compressed(out)
    sentence = refused(replace(RECIPE, **OTHERS[words]), out)
    assert "run.h5 holds the compression of a packing with " in sentence
    assert words in sentence
    assert sentence.endswith("; write to another file, or use again to replace it")


def test_the_compression_of_another_mixture_is_refused(tmp_path):
    sample = replace(RECIPE, particles=monodisperse(1.0))
    out = tmp_path / "packing.h5"
    compressed(out)
    add_attributes(run_of(out), sample.attributes())
    assert "expected those of another mixture" in refused(sample, out)


@pytest.mark.lammps
def test_the_compression_of_another_sample_is_replaced_where_that_is_asked_for(
    tmp_path, monkeypatch
):
    write_every_mark(monkeypatch)
    out = tmp_path / "packing.h5"
    for damaged in (False, True):
        compressed(out)
        if damaged:
            cut(run_of(out))
        monkeypatch.setattr(approach, "ROWS_PER_MARK", 1)
        other = replace(RECIPE, particles=bidisperse(0.0), way=FAST)
        assert stage_of(made(other, out, 1, again=True)[0]) == "compression"
        assert read_attributes(run_of(out))["alpha"] == 0


def cut(path):
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])


def edited(name, value):
    def edit(path):
        with h5py.File(path, "r+") as file:
            file["particles/all"][name][...] = value

    return edit


def renamed_shape(path):
    with h5py.File(path, "r+") as file:
        file["particles/all"].attrs["shape_style"] = "superellipsoid"


def emptied(path):
    with h5py.File(path, "r+") as file:
        for name in ("position", "orientation", "image"):
            del file["particles/all"][name]["value"]
            file["particles/all"][name]["value"] = np.zeros((2, 0, 2))


DAMAGE = {
    "is truncated or damaged, expected a complete HDF5 file; write it again": cut,
    "is not an HDF5 file, expected one written by jamshape": lambda path: path.write_text("none"),
    "position holds NaN or infinity, expected finite numbers": edited("position/value", np.nan),
    "diameters hold -1.0, expected positive lengths": edited("diameters", -1.0),
    "packing has no particles, expected at least one": emptied,
}


@pytest.mark.parametrize("words", DAMAGE)
@pytest.mark.parametrize("stage", ["run", "search"])
def test_damaged_files_are_refused_and_kept(tmp_path, monkeypatch, words, stage):
    out = tmp_path / "packing.h5"
    compressed(out)
    if stage == "search":
        write_every_mark(monkeypatch)
        made(RECIPE, out, 1)
    path = {"run": run_of, "search": making_of}[stage](out)
    DAMAGE[words](path)
    sentence = refused(RECIPE, out)
    assert sentence.startswith(f"{path}: ")
    assert words in sentence


def test_the_compression_of_another_shape_is_refused(tmp_path):
    out = tmp_path / "packing.h5"
    compressed(out)
    renamed_shape(run_of(out))
    words = "of shape 'superellipsoid' in 2 dimensions, expected 16 of 'spherocylinder' in 2"
    assert words in refused(RECIPE, out)


def test_a_finished_packing_of_another_sample_or_shape_is_refused(tmp_path):
    out = tmp_path / "packing.h5"
    landscape, found = minimum()
    write_minimum(out, landscape, found, RECIPE.attributes())
    require_same(out, RECIPE)
    for words, changes in OTHERS.items():
        with pytest.raises(ValueError, match=f"holds a packing with {words}; write to another"):
            require_same(out, replace(RECIPE, **changes))
    with pytest.raises(ValueError, match="with u0 = 1e-12, expected 1e-10; write to another file"):
        require_same(out, replace(RECIPE, target=Target(1e-10)))
    renamed_shape(out)
    with pytest.raises(ValueError, match="of shape 'superellipsoid' in 2 dimensions, expected"):
        require_same(out, RECIPE)


def test_a_file_that_is_no_finished_packing_is_neither_done_nor_replaced(tmp_path):
    out = tmp_path / "run.h5"
    write_packing(out, start(), {"kappa": 1e-6})
    sentence = (
        r"run\.h5 holds no finished packing, expected one of make_packing\.py; write to anoth"
    )
    with pytest.raises(ValueError, match=sentence):
        is_done(out)


@pytest.mark.lammps
def test_a_compression_that_was_killed_goes_on_to_a_result(tmp_path, monkeypatch):
    write_every_mark(monkeypatch)
    sample = Recipe(bidisperse(0.0), n=16, phi_start=0.5, target=Target(1e-6), way=FAST)
    rows = made(sample, tmp_path / "unbroken.h5", 150)
    out = tmp_path / "packing.h5"
    made(sample, out, approach.ROWS_PER_MARK + 10)
    assert not read_attributes(run_of(out))["finished"]
    monkeypatch.undo()  # the rest need not be written at every mark
    progress = made(sample, out)
    assert {stage_of(at) for at in progress} == {"compression", "search"}
    rest = rows[approach.ROWS_PER_MARK :]
    assert [at.text for at in progress[: len(rest)]] == [at.text for at in rest]
    assert read_attributes(run_of(out))["finished"]
    assert summary_of(out)["reached"]


@pytest.mark.lammps
def test_a_start_that_cannot_be_placed_leaves_no_file(tmp_path):
    sample = Recipe(bidisperse(4.0), n=16, phi_start=0.95)
    with pytest.raises((ValueError, InsertionError)):
        make(sample, tmp_path / "packing.h5")
    assert not list(tmp_path.iterdir())


def test_what_a_kill_after_the_last_write_leaves_goes_with_the_next_call(tmp_path):
    out = tmp_path / "packing.h5"
    rods, tiny = (
        js.Spherocylinders(alpha=1),
        {"n": 12, "u0": 1e-6, "protocol": "steps", "file": out},
    )
    made = js.make_packing(rods, **tiny, phi_start=0.5, delta_phi=0.02, progress=False)
    making_of(out).touch()
    again = js.make_packing(rods, **tiny, phi_start=0.5, delta_phi=0.02, progress=False)
    assert [path.name for path in tmp_path.iterdir()] == [out.name]
    np.testing.assert_array_equal(made.position, again.position)


FROM_LOOSE = Recipe(bidisperse(0.0), n=16, phi_start=0.6, target=Target(1e-6), way=FAST)


@pytest.fixture(scope="module")
def rates(tmp_path_factory):
    """Rates of the rows of a compression."""
    out = tmp_path_factory.mktemp("usual") / "usual.h5"
    make(FROM_LOOSE, out)
    return read_observables(run_of(out))["kappa"]


@pytest.mark.lammps
@pytest.mark.parametrize("which", ["first change of the rate", "last row before the opening"])
def test_a_kill_where_the_rate_changes_is_gone_on_from_to_the_bit(
    rates, tmp_path, monkeypatch, which
):
    sample, kappa = FROM_LOOSE, rates
    whole, cut = (tmp_path / f"{name}.h5" for name in ("whole", "cut"))
    changes = np.flatnonzero(np.diff(kappa))
    row = changes[0] if which.startswith("first") else np.flatnonzero(kappa > 0)[-1]
    # A restart file at this very row, which orders particles anew.
    write_every_mark(monkeypatch)
    monkeypatch.setattr(approach, "ROWS_PER_MARK", int(row) + 1)
    make(sample, whole)
    made(sample, cut, row + 1)
    make(sample, cut)
    one, other = (read_observables(run_of(path)) for path in (whole, cut))
    for name in ("kappa", "phi", "pressure"):
        np.testing.assert_array_equal(other[name], one[name])
    np.testing.assert_array_equal(read_packing(cut).position, read_packing(whole).position)


@pytest.mark.parametrize(
    ("last", "is_told"),
    [(math.nan, False), (1e-14, False), (math.nextafter(1e-14, 1.0), False), (1.6e-13, True)],
)
def test_what_is_left_of_a_search_is_told_where_its_energy_falls(last, is_told):
    """Energies may differ by rounding alone, as in a packing of 256 nearly round rods."""
    search = Search(State.of(random_packing(4, 0.1, 1)), 1e-4)
    search.history.add(1, 1e-9, 1e-14)
    text = stages.progress_of(search, Target(u0=1e-15), last, Interaction())
    assert ("more of it" in text) is is_told
