"""Arguments of public functions: numbers of every kind are taken, all else is refused in one sentence."""

from __future__ import annotations

import inspect
from fractions import Fraction

import numpy as np
import pytest

import jamshape as js
from jamshape.arguments import ArgumentTypeError, checked
from jamshape.front.pictures import _DRAWN
from jamshape.front.run import CyclicShearFile, QuasistaticShearFile, RunFile, ShearFile

RODS = js.Spherocylinders(alpha=1)
HERE = {"n": 8, "progress": False}


def scene(n=4):
    return js.Packing(
        position=np.arange(2.0 * n).reshape(n, 2), orientation=np.zeros(n), diameters=np.ones((n, 3)),
        species=np.ones(n, int), id=np.arange(1, n + 1), box=js.Box(lo=[0, 0], edges=[9, 9]),
    )  # fmt: skip


class Nonsense:
    """A type that no function accepts."""


NEEDED = {
    "particles": RODS,
    "packing": scene(),
    "thing": scene(),
    "path": "x.h5",
    "file": "x.h5",
    "seeds": [1],
    "n": 4,
}
NEEDED |= {"first": scene(), "second": scene()}
FUNCTIONS = {name: getattr(js, name) for name in js.__all__ if inspect.isroutine(getattr(js, name))}
CONSTRUCTORS = {
    "Kind": js.Kind,
    "Particles": js.Particles,
    "Particles.of": js.Particles.of,
    "Particles.mixture": js.Particles.mixture,
    "Particles.given": js.Particles.given,
    "Box": js.Box,
}
OTHERS = {"size": 1.0, "shape": "dimer", "kinds": [js.Kind()], "diameters": [[2, 1, 1]], "told": {}}
OTHERS |= {"draw": RODS.draw, "lo": [0, 0], "edges": [1, 1]}


def parameters():
    for name, function in (FUNCTIONS | CONSTRUCTORS).items():
        for parameter in inspect.signature(function).parameters.values():
            if parameter.kind is not inspect.Parameter.VAR_KEYWORD and parameter.name != "draw":
                yield pytest.param(function, parameter.name, id=f"{name}-{parameter.name}")


@pytest.mark.parametrize(("function", "name"), list(parameters()))
@pytest.mark.parametrize("wrong", [Nonsense(), Nonsense], ids=["object", "class"])
def test_what_is_of_no_known_type_is_refused_by_name(function, name, wrong, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    needed = [
        p.name for p in inspect.signature(function).parameters.values()
        if p.default is inspect.Parameter.empty and p.kind is not inspect.Parameter.VAR_KEYWORD
    ]  # fmt: skip
    known = NEEDED | OTHERS | ({"shape": RODS.shape} if function is js.Particles else {})
    given = {one: known[one] for one in needed} | {name: wrong}
    with pytest.raises((TypeError, ValueError)) as refused:
        function(**given)
    sentence = str(refused.value)
    assert name in sentence
    assert "expected" in sentence
    assert "\n" not in sentence
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (
            lambda: js.quasistatic_shear("x.h5"),
            "particles is 'x.h5', expected particles such as Part",
        ),
        (
            lambda: js.make_packing(js.Spherocylinders),
            "particles is the function Spherocylinders itself, exp",
        ),
        (lambda: js.compress(scene()), "particles is .*expected particles such as"),
        (lambda: js.compress(RODS, phi=0.9), "phi is 0.9, expected a tuple of 2 numbers$"),
        (
            lambda: js.slow_compress(RODS, phi=0.9),
            r"phi is 0.9, expected a tuple of 2 numbers such as \(None, 0.9\)$",
        ),
        (lambda: js.compress(RODS, n=True), "n is True, expected a whole number of particles"),
        (lambda: js.compress(RODS, dt=np.ma.masked), "dt is masked, expected a time step from"),
        (
            lambda: js.compress(RODS, dt=np.array([0.1])),
            r"dt is array\(\[0.1\]\), expected a time step",
        ),
        (lambda: js.slow_compress(RODS, kappa=[1, 2]), r"kappa is \[1, 2\], expected a rate from"),
        (lambda: js.compress(RODS, kappa=1e-3 + 0j), "kappa is .*j.*, expected a rate"),
        (lambda: js.compress(RODS, kappa=np.nan), "kappa is nan, expected a rate"),
        (lambda: js.save(scene(), "x.h5"), "path is .*Packing.*, expected a path"),
        (lambda: js.modes(RODS), "packing is Particles.*, expected a packing or a path"),
        (lambda: js.plot(scene(), "axes"), "axes is 'axes', expected matplotlib axes without"),
        (lambda: js.Spherocylinders(None), "alpha has dtype object, expected real numbers"),
        (lambda: js.Spherocylinders([1, [2, 3]]), "alpha has rows of different lengths"),
        (
            lambda: js.Kind({"alpha": None}),
            "parameters is .*expected a mapping of names to numbers",
        ),
        (
            lambda: js.Particles.mixture("spherocylinder", [js.Kind({"alpha": "1"})]),
            "alpha is '1', expected",
        ),
        (lambda: scene().with_(box=[1, 2]), r"box is \[1, 2\], expected a Box"),
        (lambda: scene().with_(position=3.0), r"position has shape \(\), expected"),
    ],
)
def test_wrong_types_are_one_sentence(call, sentence):
    with pytest.raises((ArgumentTypeError, ValueError), match=f"^{sentence}"):
        call()


MASKED = "a masked array"
WRONG_ARRAYS = {
    MASKED: lambda x: np.ma.array(x, mask=np.zeros(np.shape(x), bool)),
    "dtype complex128": lambda x: np.asarray(x) + 0j,
    "dtype <U": lambda x: np.asarray(x).astype(str),
    "dtype object": lambda x: np.asarray(x).astype(object),
    "dtype datetime64": lambda x: np.asarray(x).astype("datetime64[s]"),
    "dtype bool": lambda x: np.asarray(x).astype(bool),
    "rows of different lengths": lambda x: [[*np.ravel(x)[:1]], [1, 2]],
}
ARRAYS = ("position", "orientation", "diameters", "species", "id", "image", "exponent")


@pytest.mark.parametrize("found", WRONG_ARRAYS)
@pytest.mark.parametrize("name", [*ARRAYS, "lo", "edges", "tilt", "alpha", "given"])
def test_arrays_of_anything_but_numbers_are_refused(name, found):
    wrong, here = WRONG_ARRAYS[found], scene()
    calls = {
        "alpha": lambda: js.Spherocylinders(alpha=wrong([1, 2])),
        "given": lambda: js.Particles.given("dimer", wrong([[2, 1, 1]])),
        "lo": lambda: js.Box(lo=wrong([0, 0]), edges=[9, 9]),
        "edges": lambda: js.Box(lo=[0, 0], edges=wrong([9, 9])),
        "tilt": lambda: js.Box(lo=[0, 0], edges=[9, 9], tilt=wrong([1])),
    }
    with pytest.raises(ValueError, match="expected") as refused:
        calls.get(name, lambda: here.with_(**{name: wrong(getattr(here, name))}))()
    sentence = str(refused.value)
    assert {"given": "diameters"}.get(name, name) in sentence
    assert found in sentence


NUMBERS = (np.float16, np.float32, np.float64, np.longdouble, np.array)
COUNTS = (np.int8, np.uint8, np.int16, np.int64, np.uint64, np.array)


@pytest.mark.parametrize("kind", [*NUMBERS, Fraction])
def test_numbers_of_every_kind_are_taken(kind):
    @checked
    def taken(number: float, pair: tuple[float, float], rates: float | None = None):
        return number, pair, rates

    found = taken(kind(0.5), (kind(0.5), kind(2)), kind(0.25))
    assert found == (0.5, (0.5, 2.0), 0.25)
    assert {type(x) for x in (found[0], *found[1], found[2])} <= {float, int}
    if kind is not Fraction:  # of which arrays are objects
        assert js.Spherocylinders(alpha=kind(0.5)).told["alpha"] == 0.5


@pytest.mark.parametrize("kind", COUNTS)
def test_whole_numbers_of_every_kind_are_taken(kind):
    packing = js.make_packing(
        RODS, n=kind(8), seed=kind(1), u0=np.float32(1e-8), progress=np.bool_(False)
    )
    assert packing.n == 8
    modes = js.modes(packing, lowest=kind(3), near=np.float32(0.1))
    assert modes.vibrational.shape == (3,)
    assert type(scene().with_(step=kind(3)).step) is int


@pytest.mark.lammps
def test_rates_of_numpy_are_taken():
    """Scalars of JAX are float32, too."""
    how = {"phi": np.float32([0.4, 0.41]), "kappa": np.float32(1e-2)}
    run = js.compress(RODS, **HERE, **how, rows=np.uint8(2), frames=np.int16(2))
    assert run.kappa == float(np.float32(1e-2))
    how = {"phi": (0.7, np.float32(0.71)), "kappa": np.float32(1e-4)}
    run = js.slow_compress(RODS, **HERE, **how)
    assert run.kappa == float(np.float32(1e-4))


def test_what_the_function_is_not_called_with_is_said_as_python_does():
    with pytest.raises(TypeError, match=r"^compress\(\) missing 1 required positional argument"):
        js.compress()
    with pytest.raises(TypeError, match=r"^compress\(\) got an unexpected keyword argument 'kapa'"):
        js.compress(RODS, kapa=1)
    assert "particles : Particles" in inspect.getdoc(js.compress)
    assert "kappa" in inspect.signature(js.compress).parameters


# --- pictures -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def quasistatic():
    return js.quasistatic_shear(RODS, phi=0.95, step=2e-3, strain=0.02, **HERE)


def test_a_quasistatic_shear_shows_itself(quasistatic):
    matplotlib = pytest.importorskip("matplotlib")
    matplotlib.use("agg")
    assert isinstance(quasistatic, QuasistaticShearFile)
    axes = quasistatic.plot()
    lines = {line.get_label(): line for line in axes.lines}
    np.testing.assert_array_equal(lines[r"shear stress $\sigma$"].get_ydata(), quasistatic.stress)
    assert "quasistatic shear" in axes.get_title()
    assert "data:image/png;base64," in quasistatic._repr_html_()
    matplotlib.pyplot.close("all")


def test_what_is_not_in_a_run_is_named(quasistatic):
    with pytest.raises(KeyError, match=r"nix is not an observable of .*expected one of .*stress"):
        quasistatic["nix"]
    with pytest.raises(ValueError, match=r"^least is nan, expected a finite number"):
        quasistatic.events(np.nan)
    with pytest.raises(ValueError, match="expected frame 99 to be one of them"):
        quasistatic.packing(99)


def test_every_run_is_drawn():
    assert {RunFile, ShearFile, CyclicShearFile, QuasistaticShearFile} <= set(_DRAWN)


@pytest.mark.parametrize("projection", ["3d", "polar"])
def test_axes_with_a_projection_are_refused(projection):
    figure = pytest.importorskip("matplotlib.figure").Figure()
    axes = figure.add_subplot(projection=projection)
    sentence = f"axes is axes with projection='{projection}', expected matplotlib axes without"
    with pytest.raises(ArgumentTypeError, match=f"^{sentence}"):
        js.plot(scene(), axes)
    figure.savefig("/dev/null", format="png")
