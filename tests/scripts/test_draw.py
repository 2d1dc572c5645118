"""analysis/draw.py, as its users run it, on packings of every shape in the plane and in space."""

import numpy as np
import pytest
from pictures import image, is_color
from thinned import in_turn

from jamshape.drawing.styles import CONTACT, KINDS, RATTLER
from jamshape.files.h5md import write_packing, write_run
from jamshape.files.lammps_text import write_data
from jamshape.packing import Box, Packing
from jamshape.shapes.table import SHAPES

SCRIPT = "draw.py"


def rgb(color):
    return [int(color[k : k + 2], 16) / 255 for k in (1, 3, 5)]


def packing(angle=(0.0, 0.0, 0.0), **changes):
    """Two rods side to side across the upper edge of the box, which touch, and a third alone."""
    fields = {
        "position": np.array([[3.0, 7.8], [3.0, 0.75], [2.0, 4.0]]),
        "orientation": np.array(angle),
        "diameters": np.array([[4.0, 1.0, 1.0], [4.0, 1.0, 1.0], [2.8, 1.4, 1.4]]),
        "species": np.array([1, 1, 2]),
        "id": np.array([1, 2, 3]),
        "box": Box(lo=np.zeros(2), edges=np.array([8.0, 8.0])),
    }
    return Packing(**(fields | changes))


def mixture(shape, dimension):
    """Particles of two kinds of a shape, on a grid in any direction."""
    n_side = {2: 3, 3: 2}[dimension]
    rng, n = np.random.default_rng(1), n_side**dimension
    grid = np.stack(np.meshgrid(*[np.arange(n_side)] * dimension), axis=-1).reshape(-1, dimension)
    species = 1 + np.arange(n) % 2
    diameters, form = np.empty((n, 3)), None
    for kind, size in ((1, 1.0), (2, 1.3)):
        known = {p.name: p.default for p in SHAPES[shape].needed}
        known |= {"w2": 2.0} if "w2" in known else {}
        known |= {"alpha": 1.0 * kind} if "alpha" in known else {}
        own = species == kind
        diameters[own], its = SHAPES[shape].sizes(known, np.full(own.sum(), size))
        form = np.empty((n, its.shape[1])) if form is None else form
        form[own] = its
    q = rng.normal(size=(n, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    edge = 1.02 * diameters.max()
    return Packing(
        position=edge * grid,
        orientation=q if dimension == 3 else rng.uniform(0, 7, n),
        diameters=diameters,
        form=form,
        species=species,
        id=np.arange(1, n + 1),
        box=Box(np.zeros(dimension), np.full(dimension, edge * n_side)),
        shape_style=shape,
    )


def test_help(help_of):
    said = help_of(SCRIPT)
    for words in ("analysis/draw.py FILE", "Marschall & Teitel", "Yuan", "--color", "--frame"):
        assert words in said


def test_user_errors_are_one_sentence(problem, tmp_path):
    out = tmp_path / "out.png"
    assert "No such file" in problem(SCRIPT, tmp_path / "none.h5", "--out", out)
    text = tmp_path / "notes.txt"
    text.write_text("nothing of the kind\n")
    assert str(text) in problem(SCRIPT, text, "--out", out)
    path = tmp_path / "packing.h5"
    write_packing(path, packing())
    assert "No such file" in problem(SCRIPT, path, "--out", tmp_path / "none" / "out.png")
    assert "expected the name of a picture" in problem(
        SCRIPT, path, "--out", tmp_path / "out.nonsense"
    )
    said = problem(SCRIPT, path, "--color", "C4", "--out", out)
    assert (
        "particles are in 2D and coloured by C4 (cubatic), expected S2 (nematic) or S4 (tetratic) there"
        in said
    )
    assert not out.exists()


def test_what_is_drawn_is_counted(report, tmp_path):
    write_packing(tmp_path / "packing.h5", packing(), {"sides": 2, "k_e": 1.0})
    out = tmp_path / "packing.png"
    found = report(SCRIPT, tmp_path / "packing.h5", "--out", out)
    assert found["out"] == str(out)
    assert (found["n"], found["rattlers"], found["contacts"]) == (3, 3, 1)
    assert found["phi"] == pytest.approx(packing().phi)
    assert found["u"] > 0
    assert [row["n"] for row in found["packings"]] == [3]
    pixels = image(out)
    height, width = pixels.shape[:2]
    assert height / width == pytest.approx(1, abs=0.12)
    red = is_color(pixels, rgb(CONTACT))
    rows = np.flatnonzero(red.any(axis=1)) / height
    # The rods touch at y = 0.27 of 8: both points near the lower edge.
    assert rows.min() > 0.85
    columns = np.flatnonzero(red.any(axis=0)) / width
    assert np.ptp(columns) > 0.3, "two points of a side-to-side contact"
    # All are rattlers, so none is grey; the small ones and the big one differ.
    assert is_color(pixels, rgb(RATTLER)).mean() < 1e-3
    for color in KINDS[:2]:
        assert is_color(pixels, rgb(color)).mean() > 0.02


@pytest.mark.parametrize(("sides", "points"), [("1", 1), ("2", 2)])
def test_the_bonds_asked_for_are_shown(report, tmp_path, sides, points):
    write_data(tmp_path / "packing.data", packing())
    report(SCRIPT, tmp_path / "packing.data", "--sides", sides, "--out", tmp_path / "p.png")
    red = is_color(image(tmp_path / "p.png"), rgb(CONTACT)).any(axis=0)
    assert np.count_nonzero(np.diff(red.astype(int)) == 1) == points + 1, "and one in the legend"


@pytest.mark.parametrize("A", [0.0, 1e-3, 6.0])
def test_discs_and_particles_longer_than_the_box(report, tmp_path, A):
    one = np.array([1])
    lone = packing(
        [0.3],
        position=np.array([[-20.0, 31.0]]),
        diameters=np.array([[2 * A + 1, 1.0, 1.0]]),
        species=one,
        id=one,
        box=Box(lo=np.array([-1.0, 2.0]), edges=np.array([4.0, 7.0])),
    )
    write_packing(tmp_path / "lone.h5", lone)
    found = report(SCRIPT, tmp_path / "lone.h5", "--out", tmp_path / "lone.png")
    assert (found["n"], found["contacts"]) == (1, 0)
    height, width = image(tmp_path / "lone.png").shape[:2]
    assert height / width == pytest.approx(7 / 4, rel=0.15)


def test_a_frame_of_a_run(report, problem, tmp_path):
    apart = np.array([[3.0, 7.8], [3.0, 1.5], [2.0, 4.0]])
    write_run(tmp_path / "run.h5", [packing(), packing(step=10, position=apart)])
    asked = ("--out", tmp_path / "p.png")
    counts = [
        report(SCRIPT, tmp_path / "run.h5", "--frame", k, *asked)["contacts"] for k in (0, -1)
    ]
    assert counts == [1, 0]
    assert "expected frame 2" in problem(SCRIPT, tmp_path / "run.h5", "--frame", 2, *asked)


DRAWN = [(name, D) for name in SHAPES for D in SHAPES[name].dimensions]
HIGHER = {2: "S4", 3: "C4"}  # order beyond the nematic one


@pytest.mark.parametrize(
    ("case", "colors"), in_turn(DRAWN, [("kind", "S2"), ("orientation", "S4"), ("one",)])
)
def test_every_shape_in_the_plane_and_in_space(report, tmp_path, case, colors):
    shape, dimension = case
    path = tmp_path / "mixture.h5"
    write_packing(path, mixture(shape, dimension))
    orders = ("S2", HIGHER[dimension])
    for one in colors:
        color = HIGHER[dimension] if one == "S4" else one
        out = tmp_path / f"{color}.png"
        asked = ("--color", color, "--dpi", 60, *(("--level", 2) if dimension == 3 else ()))
        found = report(SCRIPT, path, *asked, "--out", out)
        assert (found["shape"], found["dimension"]) == (shape, dimension)
        assert ("mean_local" in found) == (color in orders)
        image(out)


def test_packings_side_by_side(report, tmp_path):
    paths = [tmp_path / f"{k}.h5" for k in range(4)]
    write_packing(paths[0], packing(), {"protocol": 1})
    for path, shape in zip(paths[1:], [*SHAPES, next(iter(SHAPES))], strict=False):
        write_packing(path, mixture(shape, 3))
    found = report(SCRIPT, *paths[:3], "--dpi", 70, "--out", tmp_path / "a.png")
    assert [row["dimension"] for row in found["packings"]] == [2, 3, 3]
    image(tmp_path / "a.png")


def test_ten_thousand_in_seconds(report, tmp_path):
    rng, side = np.random.default_rng(1), 100
    grid = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    R = rng.uniform(0.5, 1.5, side**2)
    many = packing(
        rng.uniform(0, 7, side**2),
        position=2.5 * grid + rng.normal(0, 0.1, (side**2, 2)),
        diameters=np.column_stack([2.5 * R, 2 * R, 2 * R]),
        species=np.ones(side**2, dtype=int),
        id=np.arange(1, side**2 + 1),
        box=Box(lo=np.zeros(2), edges=np.full(2, 2.5 * side)),
    )
    write_packing(tmp_path / "many.h5", many)
    found = report(SCRIPT, tmp_path / "many.h5", "--out", tmp_path / "many.png")
    assert found["n"] == side**2
    image(tmp_path / "many.png")
