"""The figures of modes and the ladder of energies, as their users run them.

On tables made up with known numbers, and on one small packing.
"""

import runpy
from pathlib import Path

import numpy as np
import pytest
from figures import words
from jamming import write_jammed
from matplotlib.figure import Figure
from mixtures import bidisperse, superellipsoids
from numpy.testing import assert_allclose
from pictures import image
from thinned import quick

from common.mode_axes import bin_edges
from common.mode_tables import read_tables
from jamshape.files.h5md import read_attributes, read_packing, write_packing
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles
from jamshape.vibration.ensembles import to_store
from jamshape.vibration.hessian import Coordinates, dynamical_matrix
from jamshape.vibration.spectrum import spectrum
from jamshape.vibration.table import ModeTable, tabulate, write_modes

ANALYSIS, FOLDER = Path(__file__).parents[2] / "analysis", "marschall_2018"
STATES, PARTICIPATION, COMPONENTS, BANDS_OF, MODES, ALONG, DISTANCE = SCRIPTS = [
    f"{FOLDER}/{name}.py"
    for name in (
        *("fig11a_density_of_states", "fig11b_participation", "fig11c_mode_components"),
        *("fig14_band_frequency", "fig12_modes", "fig13_energy_along_modes"),
        "fig14_jamming_distance",
    )
]
OF_MODES = SCRIPTS[:4]

N = 40
BANDS = {"low": 3, "middle": 5, "high": 110}
U0 = 1e-15


def sizes_at(u):
    """sqrt(|lambda|) of low and middle modes: of the exponents 1/2 and 1/4 of the paper."""
    low = 1e-8 * np.array([1, 2, 3]) * (u / U0) ** 0.5
    middle = 1e-4 * np.linspace(1, 2, 5) * (u / U0) ** 0.25
    return low, middle


def made_up(alpha, u, seed, *, n=N):
    """A table of modes; the first two of the low band are unstable."""
    rng = np.random.default_rng(seed)
    low, middle = sizes_at(u)
    high = np.sqrt(rng.uniform(1e-4, 4, BANDS["high"]))
    values = np.concatenate([[0.0, 0.0], low**2 * [-1, -1, 1], middle**2, high**2])
    band = np.repeat([-1, 0, 1, 2], [2, *BANDS.values()])
    k = len(values)
    shares = rng.dirichlet([1, 1, 1], k).T
    columns = {
        "eigenvalues": values,
        "omega": np.sign(values) * np.sqrt(np.abs(values)),
        "sign": np.sign(values).astype(np.int64),
        "solver_error": 1e-3 * np.abs(values),
        "entry_error": 0.0 * values,
        "overlap_error": 0.0 * values,
        "state_error": np.where(band == 0, 2e-16, 0.0),
        "is_translation": band == -1,
        "participation": np.where(band == 2, 0.7, 1 / n),
        **dict(zip(("parallel", "perpendicular", "rotation"), shares, strict=True)),
        "of_round": 0.0 * values,
        "band": band,
    }
    particle, kind = np.repeat(np.arange(n), 3), np.tile(np.arange(3), n)
    coordinates = Coordinates(particle, kind, np.tile(np.eye(3), (n, 1)), n, 2)
    order = np.argsort(values)
    columns = {name: values[order] for name, values in columns.items()}
    numbers = {"n_backbone": n, "n_modes": k, "n_translations": 2, "z": 5.8}
    packing = {"shape": "spherocylinder", "alpha": alpha, "u0": u, "seed": seed, "n": n}
    packing["size_ratio"] = 1.4
    attributes = numbers | {f"packing_{name}": value for name, value in packing.items()}
    return ModeTable(columns, np.empty((3 * n, 0)), coordinates, np.empty(0), attributes)


def write(folder, alpha, u, seed, **changes):
    path = folder / f"alpha{alpha:g}_u{u:g}_seed{seed}.h5"
    write_modes(path, made_up(alpha, u, seed, **changes), {}, vectors=False)
    return path


@pytest.fixture(scope="module")
def modes(tmp_path_factory):
    """Modes of two alphas, two samples and four energies; a packing among them is left out."""
    folder = tmp_path_factory.mktemp("modes")
    for alpha in (0.01, 4.0):
        for u in (1e-18, 1e-15, 1e-14, 1e-12):
            for seed in (1, 2):
                write(folder, alpha, u, seed)
    write_packing(folder / "packing.h5", random_packing(8, 0.3, 1, bidisperse(1)))
    return folder


def with_modes(folder, particles, phi):
    """A small packing and its modes, as files; the table of its modes."""
    landscape, minimum = write_jammed(folder / "packing.h5", particles, 14, phi)
    matrix = dynamical_matrix(landscape, minimum.state)
    table = tabulate(landscape, minimum.state, matrix, spectrum(matrix))
    stored = to_store(read_attributes(folder / "packing.h5"), landscape.particles)
    write_modes(folder / "modes.h5", table, stored, vectors=True)
    write_modes(folder / "bare.h5", table, stored, vectors=False)
    return table


@pytest.fixture(scope="module")
def jammed(tmp_path_factory):
    """Jammed packing of rods."""
    folder = tmp_path_factory.mktemp("jammed")
    return folder, with_modes(folder, bidisperse(1), 0.84)


@pytest.mark.parametrize("script", SCRIPTS)
def test_help(help_of, script):
    said = help_of(script)
    assert "of Marschall & Teitel, PRE 97, 012905" in said
    assert f"python analysis/{script}" in said
    assert "--out" in said


def test_density_of_states(report, modes, tmp_path):
    out = tmp_path / "a.png"
    rows = report(STATES, modes, "--u0", U0, "--out", out)["bands"]
    assert [row["alpha"] for row in rows] == [0.01, 4.0]
    for row in rows:
        assert row["samples"] == 2
        for band, count in BANDS.items():
            assert_allclose(row[band]["fraction"]["value"], count / (3 * N - 2))
        assert row["low"]["unstable"] == [2, 2]
        assert row["unsure"] == 0
    assert rows[1]["low"]["paper"] == 0.0638
    rows = report(STATES, modes, "--alpha", 4, "--out", out)["bands"]
    assert [row["u0"] for row in rows] == [1e-18, 1e-15, 1e-14, 1e-12]
    assert [row["low"]["paper"] for row in rows] == [None, 0.0638, None, None]


def test_bands_of_one_curve_are_named_with_their_fractions(here, modes, tmp_path, monkeypatch):
    figures = []  # whose words are known before they are drawn
    monkeypatch.setattr(
        Figure, "savefig", lambda figure, place, **_: (figures.append(figure), Path(place).touch())
    )
    assert here(STATES, modes, "--alpha", 4, "--u0", U0, "--out", tmp_path / "one.png") == 0
    total = sum(BANDS.values())
    for band, count in BANDS.items():
        assert f"{band} band: {count / total:.4f} of all modes (paper " in words(figures[0])
    assert here(STATES, modes, "--out", tmp_path / "all.png") == 0
    assert "band:" not in words(figures[1])


def test_density_is_normalised(modes):
    script = runpy.run_path(str(ANALYSIS / STATES))
    samples = next(of for key, of in read_tables([modes]).items() if key.u0 == U0)
    edges = bin_edges(samples)
    both = [script["densities"](samples, edges, below=below) for below in (False, True)]
    # Translations are no modes of vibration, and do not count.
    assert_allclose((sum(both) * np.diff(edges)).sum(axis=1), 1)


@pytest.mark.usefixtures("undrawn")
def test_participation(report, modes, tmp_path):
    rows = report(PARTICIPATION, modes, "--out", tmp_path / "a.png")["participation"]
    for row in rows:
        assert_allclose(row["high"]["value"], 0.7)
        assert_allclose(row["low"]["value"], 1 / N)


@pytest.mark.usefixtures("undrawn")
def test_components(report, modes, tmp_path):
    arguments = (modes, "--alpha", 4, "--u0", U0, 1e-12, "--out", tmp_path / "a.png")
    for row in report(COMPONENTS, *arguments)["components"]:
        for band in BANDS:
            assert_allclose(sum(part["value"] for part in row[band].values()), 1)


def test_band_frequencies_and_exponents(report, modes, tmp_path):
    rows = report(BANDS_OF, modes, "--out", tmp_path / "a.png")["bands"]
    assert len(rows) == 4
    for row in rows:
        expected = {"low": 0.5, "middle": 0.25}[row["band"]]
        assert_allclose(row["exponent"]["value"], expected, rtol=1e-9)
        low, middle = sizes_at(1e-14)
        mean = {"low": low, "middle": middle}[row["band"]].mean()
        assert_allclose(row["omega"]["1e-14"]["value"], mean)
        if row["band"] == "low":
            assert_allclose(row["omega_positive"]["1e-14"], low[2])
            assert_allclose(row["omega_negative"]["1e-14"], low[:2].mean())
        else:
            assert row["omega_negative"] == {}


def test_jamming_distance(report, problem, tmp_path):
    packing = random_packing(8, 0.3, 1, bidisperse(4))
    for seed, phi_J in ((1, 0.86), (2, 0.87)):
        for u in (1e-17, 1e-15, 1e-13):
            attributes = {"alpha": 4.0, "seed": seed, "u0": u, "outcome": "converged"}
            attributes |= {"phi": phi_J + 2.9 * u**0.5, "phi_J": phi_J}
            write_packing(tmp_path / f"{seed}_{u:g}.h5", packing, attributes)
    out = tmp_path / "a.png"
    (row,) = report(DISTANCE, tmp_path, "--out", out)["jamming_distance"]
    assert_allclose(row["exponent"]["value"], 0.5, rtol=1e-6)
    assert_allclose(row["distance"]["1e-15"]["value"], 2.9e-15**0.5, rtol=0.8)
    assert row["paper"]["1e-15"] == 9.1e-8
    # One that rearranged on the way, to another phi_J, is left out.
    elsewhere = {"alpha": 4.0, "seed": 1, "u0": 1e-11, "outcome": "converged"}
    elsewhere |= {"phi": 0.861, "phi_J": 0.861 - 2.9 * 1e-11**0.5}
    write_packing(tmp_path / "1_1e-11.h5", packing, elsewhere)
    (again,) = report(DISTANCE, tmp_path, "--out", out)["jamming_distance"]
    assert again["distance"] == row["distance"]
    (tmp_path / "1_1e-11.h5").unlink()
    one = tmp_path / "1_1e-17.h5"
    assert "no sample at two energies" in problem(DISTANCE, one, "--out", out)


@pytest.mark.usefixtures("undrawn")
def test_modes_of_a_packing(report, problem, jammed, tmp_path):
    folder, table = jammed
    packing, out = folder / "packing.h5", tmp_path / "a.png"
    rows = report(MODES, packing, "--modes", folder / "modes.h5", "--out", out)["modes"]
    assert rows
    for row in rows:
        assert row["eigenvalue"] == table["eigenvalues"][row["mode"]]
        assert row["parallel"] + row["perpendicular"] + row["rotation"] == pytest.approx(1)
    last = len(table["omega"]) - 1
    # Found here, to rounding.
    arguments = (packing, "--mode", last, "--omega", 1.0, "--zoom", "--out", out)
    stiff, near = report(MODES, *arguments)["modes"]
    assert_allclose(stiff["eigenvalue"], table["eigenvalues"][last], rtol=1e-9)
    assert abs(np.log(near["omega"])) <= np.abs(np.log(np.abs(table["omega"][-5:]))).min() + 1e-12
    bare = folder / "bare.h5"
    assert "has no vectors" in problem(MODES, packing, "--modes", bare, "--out", out)
    assert "no mode 999" in problem(MODES, packing, "--mode", 999, "--out", out)


def test_energy_along_modes(report, problem, jammed, tmp_path):
    folder, table = jammed
    packing, out = folder / "packing.h5", tmp_path / "a.png"
    last = len(table["omega"]) - 1
    arguments = ("--modes", folder / "modes.h5", "--mode", last, "--from", 1e-9, "--to", 1e-2)
    (row,) = report(ALONG, packing, *arguments, "--out", out)["modes"]
    assert row["eigenvalue"] == table["eigenvalues"][last]
    assert abs(row["slope_at_0"]) < 1e-12
    assert row["crossover"] is None
    wrong = problem(ALONG, packing, "--from", 1, "--to", 0.1, "--out", out)
    assert "expected 0 < from < to" in wrong


OTHERS = {
    "superellipses": (superellipsoids(1.5, 0.7), 0.86),
    "dimers": (Particles.of("dimer", alpha=1.0), 0.82),
}


@pytest.mark.parametrize("name", quick(OTHERS, {"dimers"}))
def test_other_shapes_have_the_same_figures(report, tmp_path, name):
    particles, phi = OTHERS[name]
    table = with_modes(tmp_path, particles, phi)
    out = ("--out", tmp_path / "a.png")
    packing, modes = tmp_path / "packing.h5", tmp_path / "modes.h5"
    system = {"shape": particles.shape.name, "dimension": 2, **particles.told}
    system.pop("size_ratio", None)
    found = report(MODES, packing, "--modes", modes, "--mode", 3, "--zoom", *out)
    assert system.items() <= found.items()
    assert found["modes"][0]["eigenvalue"] == table["eigenvalues"][3]
    image(tmp_path / "a.png")
    (row,) = report(ALONG, packing, "--modes", modes, "--mode", 5, "--from", 1e-6, *out)["modes"]
    assert row["eigenvalue"] == table["eigenvalues"][5]
    of_modes = {STATES: "bands", PARTICIPATION: "participation", COMPONENTS: "components"}
    for script, rows in of_modes.items():
        (row,) = report(script, modes, *out)[rows]
        assert (system | {"u0": 1e-12}).items() <= row.items()
        image(tmp_path / "a.png")


def test_ladder_is_climbed_once(report, jammed, tmp_path):
    folder, _ = jammed
    energies = (1e-13, 1e-12, 1e-11)
    arguments = (folder / "packing.h5", "--u0", *energies, "--out", tmp_path)
    for made in (3, 0):
        found = report("energy_ladder.py", *arguments)
        assert (found["made"], found["reached"], found["failed"]) == (made, 3, 0)
    rungs = {row["u0"]: row for row in found["ladder"]}
    distance = {}
    for u in energies:
        path = Path(rungs[u]["out"])
        stored = read_attributes(path)
        assert_allclose([stored["u"], stored["u0"]], u, rtol=1e-7)
        assert stored["residual"] < 1e-6
        assert stored["seed"] == 1
        assert read_packing(path).phi == pytest.approx(stored["phi"])
        distance[u] = stored["phi"] - rungs[1e-13]["phi_J"]
    assert_allclose(distance[1e-11] / distance[1e-13], 10, rtol=1e-3)


def test_ladders_of_other_packings_are_refused(here, jammed, tmp_path):
    folder, _ = jammed
    packing = folder / "packing.h5"
    other = read_attributes(packing) | {"seed": 7, "u0": 1e-13}
    write_packing(tmp_path / "packing_u1e-13.h5", read_packing(packing), other)
    said = here("energy_ladder.py", packing, "--u0", 1e-13, "--out", tmp_path)
    assert "seed = 7, expected 1" in said
    said = here("energy_ladder.py", tmp_path / "none.h5", "--u0", 1e-13, "--out", tmp_path)
    assert "does not exist" in said


@pytest.mark.parametrize("script", OF_MODES)
def test_user_errors_are_one_sentence(problem, modes, tmp_path, script):
    out = tmp_path / "out.png"
    assert "none.h5" in problem(script, tmp_path / "none.h5", "--out", out)
    (tmp_path / "empty").mkdir()
    assert "no modes, expected files" in problem(script, tmp_path / "empty", "--out", out)
    assert "no modes have alpha = 7" in problem(script, modes, "--alpha", 7, "--out", out)
    packing = modes / "packing.h5"
    assert "packing.h5: is not a complete file of modes" in problem(script, packing, "--out", out)
    more = write(tmp_path, 4.0, U0, 3, n=N + 1)
    assert "expected one ensemble" in problem(script, modes, more, "--out", out)
    assert not out.exists()
