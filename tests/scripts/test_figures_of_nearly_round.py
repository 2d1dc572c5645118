"""Contacts and forces of nearly round particles, on a small sweep made here and on numbers that are known."""

import runpy
from pathlib import Path

import numpy as np
import pytest
from pictures import image

import jamshape as js
from common.small_values import Distribution, exponent_of, extrapolated
from jamshape.files.ensembles import PackingFile

FOLDER = "brito_2018"
ANALYSIS = Path(__file__).parents[2] / "analysis"
W1 = (0.95, 0.9, 0.8)


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Two packings of discs and of each ellipse."""
    folder = tmp_path_factory.mktemp("nearly_round")
    shapes = [js.Spherocylinders(alpha=0.0)]
    shapes += [js.Superellipsoids(p=1, w1=w1, w2=1, size_ratio=1.4) for w1 in W1]
    for k, shape in enumerate(shapes):
        for seed in (1, 2):
            file = folder / f"{k}_{seed}.h5"
            js.make_packing(
                shape, n=24, seed=seed, dimension=2, u0=1e-15, file=file, progress=False
            )
    return folder


def test_contacts_above_those_of_discs(report, sweep, tmp_path):
    out = tmp_path / "c.png"
    found = report(f"{FOLDER}/contacts.py", sweep, "--out", out)
    image(out)
    Deltas = sorted(row["Delta"] for row in found["shapes"])
    assert Deltas == pytest.approx([1 / w1 - 1 for w1 in W1])
    assert found["packings"] == found["hypostatic"] == 6
    [fit] = found["powers"]
    assert fit["family"] == "ellipses in 2D"
    assert fit["x"] > 0


def test_contacts_need_round_particles(problem, sweep, tmp_path):
    ellipses = [sweep / f"{k}_1.h5" for k in (1, 2)]
    assert "of round particles" in problem(
        f"{FOLDER}/contacts.py", *ellipses, "--out", tmp_path / "x.png"
    )


@pytest.mark.parametrize(("name", "fewest"), [("forces", 80), ("gaps", 2)])
def test_small_values_of_each_shape(name, fewest, report, sweep, tmp_path):
    out = tmp_path / "f.png"
    found = report(f"{FOLDER}/{name}.py", sweep, "--out", out)
    image(out)
    Deltas = sorted(row["Delta"] for row in found[name])
    assert Deltas == pytest.approx([0, *sorted(1 / w1 - 1 for w1 in W1)], abs=1e-8)
    assert all(row["count"] > fewest for row in found[name])


def test_gaps_of_discs_are_their_distances(sweep):
    gaps_of = runpy.run_path(str(ANALYSIS / FOLDER / "gaps.py"))["gaps_of"]
    file = PackingFile.read(sweep / "0_1.h5")
    packing, rattlers = file.packing(), file.contacts().rattlers
    i, j = np.triu_indices(packing.n, 1)
    held = ~(rattlers[i] | rattlers[j])
    edges = packing.box.edges
    apart = packing.position[i] - packing.position[j]
    r = np.linalg.norm(apart - edges * np.rint(apart / edges), axis=1)
    gaps = (r / (packing.radius[i] + packing.radius[j]) - 1)[held]
    expected = np.sort(gaps[(gaps > 1e-7) & (gaps < 0.2)])
    np.testing.assert_allclose(np.sort(gaps_of(file)), expected, rtol=0.06)


def test_shear_modulus_of_each_shape(report, sweep, tmp_path):
    ladder, out = tmp_path / "ladder", tmp_path / "s.png"
    packings = [sweep / f"{name}.h5" for name in ("0_1", "0_2", "1_1")]
    energies = ("1e-12", "1e-8", "1e-6")
    report("energy_ladder.py", *packings, "--u0", *energies, "--out", ladder)
    found = report(f"{FOLDER}/shear_modulus.py", ladder, "--out", out)
    image(out)
    discs, ellipses = found["shapes"]
    assert (discs["Delta"], ellipses["Delta"]) == pytest.approx((0, 1 / W1[0] - 1))
    assert (discs["samples"], len(discs["points"])) == (2, len(energies))
    moduli = [js.modes(js.load(ladder / f"0_{seed}_u1e-08.h5")).moduli for seed in (1, 2)]
    G = np.mean([of.B.G_dc.relaxed / of.bulk.relaxed for of in moduli])
    assert discs["points"][1]["G"] == pytest.approx(G, rel=1e-6)
    assert discs["points"][0]["p"] < 1e-2 * discs["points"][1]["p"] * 1.1
    found = report(f"{FOLDER}/shear_modulus.py", ladder, "--fit-to", 1e-9, "--out", out)
    assert [one["beta"] for one in found["shapes"]] == [None, None]  # no pressure to fit


@pytest.mark.parametrize("theta", [-0.41, 0.0, 0.175, 0.423])
def test_exponents_of_small_values_are_found(theta):
    uniform = (np.arange(20000) + 0.5) / 20000
    found, error = exponent_of(0.2 * uniform ** (1 / (1 + theta)), 0.2)
    assert found == pytest.approx(theta, abs=1e-3)
    assert error == pytest.approx((1 + theta) / 20000**0.5, rel=1e-2)


@pytest.mark.parametrize("theta", [-0.3, 0.0, 0.175])
def test_exponents_are_extrapolated_to_a_bound_of_zero(theta):
    rng = np.random.default_rng(1)
    found = []
    for _ in range(200):
        x = rng.random(20000) ** (1 / (1 + theta))
        kept = x[rng.random(20000) < (1 + x) / 2]  # of the density x^theta (1 + x)
        found.append((*extrapolated(kept, 0.5), exponent_of(kept, 0.5)[0]))
    exponents, errors, below = np.array(found).T
    assert below.mean() > theta + 0.07
    assert exponents.mean() == pytest.approx(theta, abs=0.03)
    assert errors.mean() == pytest.approx(exponents.std(), rel=0.15)


@pytest.mark.parametrize(("theta", "has_power"), [(0.0, 0), (0.2, 1)])
def test_a_finite_density_that_rises_is_no_power_law(theta, has_power):
    rng = np.random.default_rng(2)
    x = rng.random(40000) ** (1 / (1 + theta))
    values = np.sort(x[rng.random(40000) < (1 + x) / 2])
    power, error = exponent_of(values, 0.5)
    found = Distribution(None, 0.1, values, power, error, extrapolated(values, 0.5))
    assert power > 2 * error
    assert found.has_power == has_power


def test_powers_of_contacts_are_found(monkeypatch):
    monkeypatch.syspath_prepend(ANALYSIS / FOLDER)
    script = runpy.run_path(str(ANALYSIS / FOLDER / "contacts.py"))
    mean = script["Mean"]
    points = [
        script["Point"](None, Delta, mean(0.0), mean(2.5 * Delta**0.5, 0.01), 1, 1)
        for Delta in (0.01, 0.03, 0.1)
    ]
    assert script["power_of"](points)[:2] == pytest.approx((2.5, 0.5))


def test_contacts_of_ellipses_against_aspect_ratio(report, sweep, tmp_path):
    out = tmp_path / "r.png"
    ellipses = [path for path in sorted(sweep.glob("*.h5")) if not path.name.startswith("0")]
    found = report("rocks_hoy_2023/aspect_ratio.py", *ellipses, "--out", out)
    image(out)
    assert (found["n_shapes"], found["shapes_below_6"]) == (3, 3)
    by_ratio = {row["aspect_ratio"]["value"]: row for row in found["shapes"]}
    assert sorted(by_ratio) == pytest.approx([1 / w1 for w1 in W1])
