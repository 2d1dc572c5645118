import hashlib
import itertools
import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from mixtures import ROD, bidisperse, monodisperse, of_arrays

from jamshape import _contact
from jamshape.files.h5md import read_packing
from jamshape.files.lammps_text import read_data
from jamshape.landscape import Landscape, State
from jamshape.measures.order import orientational_order
from jamshape.minima import Outcome, Stop, minimise
from jamshape.protocols.random_start import (
    InsertionError,
    dilute_packing,
    random_packing,
    start_below,
    usual_phi_start,
)
from jamshape.shapes.particles import Particles, Sizes
from jamshape.shapes.table import shape_named

DRIVER = Path(__file__).parents[3] / "pyscripts" / "make_initial.py"

IN_TINY_BOXES = [
    (1, 0.4, bidisperse(4), 2),
    (2, 0.5, bidisperse(4), 2),
    (3, 0.4, bidisperse(20), 2),
    (1, 0.1, monodisperse(100), 2),
    (8, 0.2, bidisperse(4), 3),
    (1, 0.3, bidisperse(4), 3),
]
IN_LARGE_BOXES = [
    (200, 0.4, bidisperse(4), 2),
    (101, 0.5, bidisperse(0), 2),
    (100, 0.5, bidisperse(1e-6), 2),
    (60, 0.05, monodisperse(100), 2),
    (200, 0.4, bidisperse(4, size_ratio=10), 2),
    (100, 0.2, bidisperse(4), 3),
    (100, 0.3, bidisperse(0), 3),
]


def smallest_gap(packing):
    """Brute force over all pairs and images: spine distance over R_i + R_j, minus 1."""
    A, R, edges = packing.half_length, packing.radius, packing.box.edges
    turns = [int(np.ceil(2 * (A + R).max() / edge)) + 1 for edge in edges]
    rows = np.column_stack([packing.position, packing.axes, A, R])
    smallest = np.inf
    for shift in itertools.product(*(range(-m, m + 1) for m in turns)):
        i, j = np.triu_indices(packing.n, k=0 if any(shift) else 1)
        image = rows[j]
        image[:, : packing.dimension] += shift * edges
        gaps = _contact.spine_distances(rows[i], image) / (R[i] + R[j]) - 1
        smallest = min(smallest, gaps.min(initial=np.inf))
    return smallest


@pytest.mark.parametrize(("n", "phi", "mixture", "dimension"), IN_TINY_BOXES + IN_LARGE_BOXES)
def test_no_overlap_at_the_packing_fraction_asked(n, phi, mixture, dimension):
    packing = random_packing(n, phi, 1, mixture, dimension=dimension)
    assert packing.n == n
    assert packing.phi == pytest.approx(phi, rel=1e-14)
    assert np.all(packing.box.edges == packing.box.edges[0])
    assert np.all((packing.position >= 0) & (packing.position <= packing.box.edges))
    assert sorted(packing.id) == list(range(1, n + 1))
    assert packing.shape_style == ROD
    assert smallest_gap(packing) >= 0


@pytest.mark.parametrize("case", IN_TINY_BOXES)
def test_tiny_boxes_are_shorter_than_a_particle(case):
    n, phi, mixture, dimension = case
    packing = random_packing(n, phi, 1, mixture, dimension=dimension)
    assert packing.diameters.max() > packing.box.edges[0]


def test_same_seed_same_packing():
    a, b, c = (random_packing(50, 0.4, seed) for seed in (7, 7, 8))
    for name in ("position", "orientation", "diameters", "species"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name))
    assert not np.any(np.isin(a.position, c.position))


@pytest.mark.parametrize("n", [64, 65])
def test_bidisperse_is_one_to_one_and_shuffled(n):
    packing = random_packing(n, 0.3, 2, bidisperse(3, 1.4))
    small = packing.species == 1
    assert (small.sum(), (packing.species == 2).sum()) == (n - n // 2, n // 2)
    assert np.all(packing.radius[small] == 0.5)
    np.testing.assert_allclose(packing.radius[~small], 0.7, rtol=1e-15)
    np.testing.assert_allclose(packing.aspect_ratio, 3, rtol=1e-14)
    assert 8 < small[:32].sum() < 24


def test_orientations_and_positions_are_uniform():
    N = 1024
    packing = random_packing(N, 0.4, 3)
    for n in (1, 2, 4):
        assert np.sqrt(N) * orientational_order(packing.orientation, n).S_n < 3
    for wave in (1, 2):
        phases = np.exp(2j * np.pi * wave * packing.position / packing.box.edges)
        assert np.all(np.sqrt(N) * np.abs(phases.mean(axis=0)) < 3)


def test_orientations_are_uniform_on_the_sphere():
    N = 400
    axes = random_packing(N, 0.1, 3, dimension=3).axes
    order = np.linalg.eigvalsh(1.5 * axes.T @ axes / N - 0.5 * np.eye(3))
    assert np.abs(order).max() < 3 / np.sqrt(N)
    assert np.linalg.norm(axes.mean(axis=0)) < 3 / np.sqrt(N)


def test_any_distribution():
    rng = np.random.default_rng(5)
    A, R = rng.uniform(0, 3, 40), rng.lognormal(0, 0.3, 40)
    packing = random_packing(40, 0.35, 5, of_arrays(A, R, np.arange(1, 41)))
    order = packing.species - 1
    np.testing.assert_allclose(packing.half_length, A[order], rtol=0, atol=1e-15)
    np.testing.assert_array_equal(packing.radius, R[order])
    assert smallest_gap(packing) >= 0

    def draw(n, rng):
        long = 1 + 2 * rng.uniform(0, 2, n)
        return Sizes(np.column_stack([long, np.ones((n, 2))]), np.ones(n), np.ones(n, int))

    drawn = random_packing(40, 0.35, 5, Particles(shape_named(ROD), draw, {}))
    assert np.ptp(drawn.half_length) > 1
    assert smallest_gap(drawn) >= 0


@pytest.mark.parametrize(
    ("n", "mixture", "dimension"),
    [
        (256, bidisperse(4), 2),
        (200, bidisperse(0, 10), 2),
        (2, bidisperse(4), 2),
        (64, bidisperse(2), 3),
    ],
)
def test_recommended_start_works(n, mixture, dimension):
    sentence = (
        rf"^random insertion of {n} particles stalled at phi = 0\.\d+ of the 0\.95 requested after"
        r" \d+ attempts: start at phi <= (0\.\d+) and compress from there$"
    )
    with pytest.raises(InsertionError, match=sentence) as error:
        random_packing(n, 0.95, 1, mixture, dimension=dimension)
    phi = float(re.match(sentence, str(error.value))[1])
    assert random_packing(n, phi, 1, mixture, dimension=dimension).n == n


@pytest.mark.parametrize("n", [16, 64, 256])
@pytest.mark.parametrize("alpha", [8, 10, 11, 14, 20, 50, 100])
def test_usual_start_has_room_for_long_particles(alpha, n):
    mixture = bidisperse(alpha)
    for seed in range(1, 9):
        phi = usual_phi_start(0.4, n, seed, mixture, 2)
        assert (phi == 0.4) == (alpha <= 10)
        assert random_packing(n, phi, seed, mixture).n == n
        assert start_below(0.8, n, seed, mixture).phi == pytest.approx(phi, rel=1e-12)


def test_usual_start_of_long_particles_in_3d_is_not_jammed():
    assert usual_phi_start(0.1, 100, 1, bidisperse(20), 3) == 0.1
    phi = usual_phi_start(0.1, 100, 1, bidisperse(50), 3)
    start = dilute_packing(100, phi, 1, bidisperse(50), 3)
    found = minimise(Landscape(start), State.of(start), "auto", Stop(1e-2, lowest=1e-16))
    assert found.outcome is Outcome.UNJAMMED


@pytest.mark.parametrize(("alpha", "dimension"), [(2, 2), (1e8, 2), (1, 3)])
def test_box_too_short_for_the_longest(alpha, dimension):
    rod = Particles.given(ROD, [[1.0 + alpha, 1.0, 1.0]])  # out of the range of options
    with pytest.raises(InsertionError, match="off its own periodic images in a box of") as error:
        random_packing(1, 0.95, 1, rod, dimension=dimension)
    phi = float(re.search("start at phi <= (.*) and", str(error.value))[1])
    assert random_packing(1, phi, 1, rod, dimension=dimension).n == 1


NO_ROD = r"a particle of the mixture is not a spherocylinder, expected \(2\(A\+R\), 2R, 2R\)"


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"n": 0}, "n is 0, expected a whole number of particles from 1 to 10000000"),
        ({"phi": 0.0}, r"phi is 0\.0, expected a packing fraction from 1e-09 to 0\.999"),
        ({"phi": 1.0}, r"phi is 1\.0, expected"),
        ({"phi": np.nan}, "phi is nan, expected"),
        ({"seed": -1}, "seed is -1, expected a seed from 0 to 9223372036854775807"),
        ({"dimension": 4}, "dimension is 4, expected 2 or 3"),
        (
            {"particles": of_arrays([1.0, -1.0], [1.0, 1.0])},
            NO_ROD,
        ),
        (
            {"particles": of_arrays([1.0, np.nan], [1.0, 1.0])},
            NO_ROD,
        ),
        (
            {"particles": of_arrays([1.0, 1.0], [0.0, 1.0])},
            NO_ROD,
        ),
        (
            {"particles": of_arrays([1.0, 1.0], [1.0, -1.0])},
            NO_ROD,
        ),
        (
            {"particles": of_arrays([1.0], [1.0])},
            r"diameters of the mixture has shape \(1, 3\), expected \(2, 3\)",
        ),
        (
            {"particles": of_arrays([1.0, 1.0], [1.0, 1.0], [0, 1])},
            "species holds 0, expected numbers from 1",
        ),
    ],
)
def test_refuses(arguments, sentence):
    with pytest.raises(ValueError, match=sentence):
        random_packing(**({"n": 2, "phi": 0.1, "seed": 1} | arguments))


def test_mixture_refuses():
    with pytest.raises(
        ValueError, match=r"size_ratio is 0\.5, expected big over small from 1 to 10"
    ):
        bidisperse(4, 0.5)
    for mixture in (bidisperse, monodisperse):
        with pytest.raises(ValueError, match=r"alpha is -1(\.0)?, expected 0 or A / R from 1e-06"):
            mixture(-1)


def run_driver(*arguments):
    command = [sys.executable, DRIVER, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("name", "reader", "dimension"), [("a.data", read_data, 2), ("a.h5", read_packing, 3)]
)
def test_driver_writes_what_it_says(tmp_path, name, reader, dimension):
    out = tmp_path / name
    options = f"--alpha 2 --n 33 --phi 0.2 --seed 4 --size-ratio 1.2 --dimension {dimension}"
    run = run_driver(*options.split(), "--out", out)
    assert (run.returncode, run.stderr) == (0, "")
    expected = random_packing(33, 0.2, 4, bidisperse(2, 1.2), dimension=dimension)
    result = json.loads(run.stdout.splitlines()[-1])
    edges = expected.box.edges.tolist()
    assert result == {"out": str(out), "n": 33, "phi": expected.phi, "box": edges}
    found = reader(out)
    np.testing.assert_array_equal(found.position, expected.position)
    np.testing.assert_array_equal(found.diameters, expected.diameters)
    np.testing.assert_allclose(found.axes, expected.axes, rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ("--phi 0.9 --n 20 --out {}/a.data", "stalled at phi"),
        ("--alpha -1 --out {}/a.data", "alpha is -1.0"),
        ("--out {}/a.txt", "expected a suffix .data or .h5"),
        ("--out {}/missing/a.data", "No such file or directory"),
    ],
)
def test_driver_fails_with_one_sentence(tmp_path, options, sentence):
    run = run_driver(*options.format(tmp_path).split())
    assert (run.returncode, run.stdout) == (1, "")
    assert len(run.stderr.splitlines()) == 1
    assert sentence in run.stderr


@pytest.mark.parametrize(
    ("n", "phi", "mixture", "dimension", "digest"),
    [
        (3000, 0.4, bidisperse(4), 2, "52bf68f69f8df4c5"),
        (400, 0.2, monodisperse(4), 3, "782204d229b4403d"),
    ],
)
def test_packings_of_a_seed_stay_what_they_are(n, phi, mixture, dimension, digest):
    """Recipes tell a seed and no start: a faster search for places must find the same ones."""
    packing = random_packing(n, phi, 1, mixture, dimension)
    assert hashlib.sha256(packing.position.tobytes()).hexdigest()[:16] == digest
