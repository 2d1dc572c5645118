"""Python with input that is none: one sentence of an exception that users may meet, before anything is written."""

from __future__ import annotations

import itertools
import math
from functools import partial

import numpy as np
import pytest

import jamshape as js
from jamshape.checks import RANGES, require_stated
from jamshape.command import PROBLEMS
from jamshape.contacts import find_contacts
from jamshape.files.h5md import read_packing, write_packing
from jamshape.files.lammps_text import read_data
from jamshape.flow.compression import Compression
from jamshape.flow.implicit import Protocol
from jamshape.flow.lammps_driver import Sizes
from jamshape.flow.shear import Shear
from jamshape.minima.target import Target
from jamshape.packing import Box
from jamshape.protocols.approach import Approach
from jamshape.protocols.quasistatic import Quasistatic
from jamshape.protocols.random_start import random_packing
from jamshape.protocols.recipe import Recipe, Thermalisation
from jamshape.shapes.particles import Particles
from jamshape.shapes.table import SHAPES

NAN = math.nan
RODS = js.Spherocylinders(alpha=1)


def shear(**options):
    return lambda: js.shear(RODS, **({"n": 8, "file": "new.h5", "progress": False} | options))


def cyclic(**options):
    return lambda: js.cyclic_shear(
        RODS, **({"n": 8, "file": "new.h5", "progress": False} | options)
    )


def aqs(**options):
    return lambda: js.quasistatic_shear(
        RODS, **({"n": 8, "file": "new.h5", "progress": False} | options)
    )


def compress(**options):
    return lambda: js.compress(RODS, **({"n": 8, "file": "new.h5", "progress": False} | options))


def make(**options):
    return lambda: js.make_packing(
        RODS, **({"n": 8, "file": "new.h5", "progress": False} | options)
    )


def slow(**options):
    return lambda: js.slow_compress(
        RODS, **({"n": 8, "file": "new.h5", "progress": False} | options)
    )


def modes(**options):
    return lambda: js.modes("start.h5", **options)


def packing(**changes):
    return lambda: find_contacts(random_packing(4, 0.2, 1).with_(**changes))


def cases():
    of_classes = {
        Compression: ("kappa", "dt", "phi_end", "k_e", "k_d", "tolerance"),
        Shear: ("gdot", "strain_end", "dt", "k_e", "k_d", "tolerance"),
        Protocol: ("kappa", "phi_end", "tolerance", "k_d", "largest_strain"),
        Approach: ("kappa", "p_end", "dt"),
        Quasistatic: ("step", "energy"),
        Target: ("u0", "tolerance"),
    }
    for kind, names in of_classes.items():
        for name, value in itertools.product(names, (NAN, math.inf, 0, "4; touch X", None, [1])):
            yield f"{kind.__name__} {name}={value}", partial(kind, **{name: value})
    for name, value in (("rows", 0), ("rows", 1.5), ("rows", "4"), ("frames", 0), ("frames", NAN)):
        yield f"Sizes {name}={value}", partial(Sizes, **{name: value})
        for record in (compress, shear):
            yield f"{record.__name__} {name}={value}", record(**{name: value})
    for integrator in ("euler", "heun\nshell touch X", "rkc2 tolerance 1", "", None, 1):
        yield f"integrator {integrator!r}", partial(Compression, integrator=integrator)
        yield f"compress integrator {integrator!r}", compress(integrator=integrator or "none")
    for name, allowed in RANGES.items():
        for value in (allowed.low - 1, allowed.high * 2 + 1, NAN, "1", None):
            yield f"range of {name}: {value}", partial(require_stated, **{name: value})
    for shape in SHAPES.values():
        for p in shape.parameters:
            for value in (
                (p.allowed.low - 1, p.allowed.high * 2 + 1, NAN) if p.allowed else ("1 x",)
            ):
                what = f"range of {p.name} of {shape.name}s: {value}"
                yield what, partial(Particles.of, shape, **{p.name: value})
    yield from {
        "compress phi falls": compress(phi=(0.4, 0.3)),
        "compress phi one": compress(phi=(0.4, 0.4)),
        "compress n half": compress(n=2.5),
        "compress n text": compress(n="8"),
        "compress dimension": compress(dimension=4),
        "compress sides": compress(sides=3),
        "compress seed": compress(seed=-1),
        "compress file": compress(file="start.h5"),
        "compress newline": compress(file="a\nshell touch X"),
        "shear gdot": shear(gdot=0.0),
        "shear rate": shear(gdot=1.0),
        "shear flow": shear(flow="complex"),
        "shear strain": shear(strain=-1.0),
        "shear too far": shear(flow="pure", strain=5.0),
        "shear long step": shear(gdot=0.05, dt=1.0),
        "shear phi": shear(phi=NAN),
        "shear file": shear(file="start.h5"),
        "shear run": shear(file="run.h5"),
        "shear start": shear(start="none.h5"),
        "shear no particles": lambda: js.shear(file="new.h5", progress=False),
        "cyclic amplitude": cyclic(amplitude=0.0),
        "cyclic period": cyclic(period=-1.0),
        "cyclic rate": cyclic(amplitude=1.0, period=1.0),
        "cyclic slow": cyclic(amplitude=1e-6, period=1e18),
        "cyclic cycles": cyclic(cycles=2.5),
        "cyclic rows": cyclic(rows=10),
        "cyclic frames": cyclic(frames=0),
        "cyclic flow": cyclic(flow="complex"),
        "cyclic too far": cyclic(flow="pure", amplitude=5.0, period=1e6),
        "cyclic integrator": cyclic(integrator="tr-bdf2"),
        "cyclic dt": cyclic(integrator="rkc2", dt=0.1),
        "cyclic tolerance": cyclic(dt=0.1, integration_tolerance=1e-3),
        "cyclic steps": cyclic(period=1e12, amplitude=1.0, dt=1e-6),
        "cyclic file": cyclic(file="run.h5"),
        "cyclic no particles": lambda: js.cyclic_shear(file="new.h5", progress=False),
        "cyclic start and phi": lambda: js.cyclic_shear(start="start.h5", phi=0.7, file="new.h5"),
        "aqs step": aqs(step=0.0),
        "aqs long step": aqs(step=0.1, strain=0.05),
        "aqs flow": aqs(flow="complex"),
        "aqs too far": aqs(flow="pure", strain=5.0),
        "aqs pressure": aqs(pressure=-1.0),
        "aqs file": aqs(file="run.h5"),
        "aqs no particles": lambda: js.quasistatic_shear(file="new.h5", progress=False),
        "make kappa": make(way="dynamics", kappa=-1.0),
        "make dimension": make(dimension=0),
        "make protocol": make(protocol=3),
        "make way": make(way="walk"),
        "make u0": make(u0=-1.0),
        "make n": make(n=0),
        "make seed": make(seed=0.5),
        "make file": make(file="start.h5"),
        "make a data file": make(file="new.data"),
        "make a folder": make(file="a folder"),
        "ensemble in a file": lambda: js.ensemble(RODS, n=8, seeds=[1], folder="start.h5"),
        "slow kappa": slow(kappa=0.0),
        "slow kappas": slow(kappa=[1e-6, 1e-7]),
        "slow falling": slow(kappa=[(0.9, 1e-6), (0.8, 1e-7)]),
        "slow none": slow(kappa=[]),
        "slow method": slow(method="euler"),
        "slow phi": slow(phi=(0.9, 0.8)),
        "slow start": slow(start="none.h5"),
        "slow no particles": lambda: js.slow_compress(file="new.h5", progress=False),
        "slow start and n": lambda: js.slow_compress(start="start.h5", n=8, file="new.h5"),
        "slow start and particles": lambda: js.slow_compress(RODS, start="start.h5", file="new.h5"),
        "slow start and phi": lambda: js.slow_compress(start="start.h5", phi=(0.7, 0.8), file="new.h5"),
        "slow p_end": lambda: js.slow_compress(start="dense.h5", phi=(None, 1.5), p_end=1e-9, file="new.h5"),
        "shear start and phi": lambda: js.shear(start="start.h5", phi=0.7, file="new.h5"),
        "shear start and particles": lambda: js.shear(RODS, start="start.h5", file="new.h5"),
        "shear dt": shear(integrator="rkc2", dt=0.1),
        "shear frames": shear(gdot=1e-8, frames=3),
        "aqs start and seed": lambda: js.quasistatic_shear(start="start.h5", seed=2, file="new.h5"),
        "compress dt": compress(integrator="rkc2", dt=0.1),
        "compress tolerance": compress(dt=0.1, integration_tolerance=1e-3),
        "make accuracy": make(way="steps", accuracy=1e-6),
        "modes method and lowest": modes(method="refined", lowest=4),
        "plot color of a run": lambda: js.plot(js.load("run.h5"), color="nematic"),
        "modes method": modes(method="exact"),
        "modes rotation": modes(rotation="turns"),
        "modes lowest": modes(lowest=0),
        "modes near": modes(near=NAN),
        "modes least force": modes(least_force=-1.0),
        "modes no minimum": modes(),
        "modes of text": lambda: js.modes("text.h5"),
        "load none": lambda: js.load("none.h5"),
        "load text": lambda: js.load("text.h5"),
        "load other": lambda: js.load("other.h5"),
        "load empty": lambda: js.load("empty.h5"),
        "load cut": lambda: js.load("cut.h5"),
        "load folder": lambda: js.load("a folder"),
        "load frame": lambda: js.load("run.h5", 99),
        "resume packing": lambda: js.resume("start.h5"),
        "resume newline": lambda: js.resume("newline.h5", progress=False),
        "resume words": lambda: js.resume("words.h5", progress=False),
        "save end": lambda: js.save("new.txt", random_packing(4, 0.2, 1)),
        "save nowhere": lambda: js.save("none/new.h5", random_packing(4, 0.2, 1)),
        "alpha": lambda: js.Spherocylinders(alpha=-1),
        "alpha nan": lambda: js.Spherocylinders(alpha=NAN),
        "alpha large": lambda: js.Spherocylinders(alpha=1e5),
        "alpha kinds": lambda: js.Spherocylinders(alpha=[1, 2], size=[1, 2, 3]),
        "beta": lambda: js.Spherocylinders(beta=1),
        "ratio": lambda: js.Spherocylinders(size_ratio=0.5),
        "ratio and kinds": lambda: js.Spherocylinders(alpha=[1, 2], size_ratio=1.4),
        "dimer": lambda: js.Dimers(alpha=0),
        "p": lambda: js.Superellipsoids(p=1e4),
        "p and n1": lambda: js.Superellipsoids(p=1, n1=20, n2=2),
        "w1": lambda: js.Superellipsoids(w1=1.5),
        "w2": lambda: js.Superellipsoids(w2=0.5),
        "kind": lambda: js.Kind(size=-1.0),
        "no kinds": lambda: js.Particles.mixture("spherocylinder", []),
        "shape": lambda: js.Particles.of("cube"),
        "diameters": lambda: random_packing(1, 0.2, 1, js.Particles.given("spherocylinder", [[-1, 1, 1]])),
        "recipe n": lambda: Recipe(n=0),
        "recipe n text": lambda: Recipe(n="8"),
        "recipe phi": lambda: Recipe(phi_start=1.0),
        "recipe dimension": lambda: Recipe(dimension=1),
        "recipe seed": lambda: Recipe(seed=-1),
        "thermal phi": lambda: Thermalisation(phi=1.0),
        "thermal sweeps": lambda: Thermalisation(n_sweeps=-1),
        "box edge": lambda: Box(np.zeros(2), np.array([1.0, -1.0])),
        "box nan": lambda: Box(np.zeros(2), np.array([1.0, NAN])),
        "positions": packing(position=np.full((4, 2), NAN)),
        "angles": packing(orientation=np.full(4, math.inf)),
        "rows of positions": packing(position=np.zeros((3, 2))),
        "diameters of a packing": packing(diameters=np.zeros((4, 3))),
        "exponents": packing(exponent=np.full(4, NAN)),
        "style": packing(shape_style="cube"),
        "IDs": packing(id=np.zeros(4, np.int64)),
        "read packing": lambda: read_packing("text.h5"),
        "read data": lambda: read_data("text.data"),
        "write to a folder": lambda: write_packing("a folder", random_packing(4, 0.2, 1)),
        "modes over a packing": lambda: js.modes("start.h5", force=True).save("start.h5"),
        "modes in a picture": lambda: js.modes("start.h5", force=True).save("new.png"),
        "modes over text": lambda: js.modes("start.h5", force=True).save("text.h5"),
    }.items()  # fmt: skip


@pytest.mark.lammps
@pytest.mark.usefixtures("place")
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("case", list(cases()), ids=lambda case: case[0])
def test_python_refuses(case):
    with pytest.raises((*PROBLEMS, TypeError)) as caught:
        case[1]()
    sentence = str(caught.value)
    assert sentence.strip()
    assert "\n" not in sentence
    assert len(sentence) < 400
    assert isinstance(caught.value, OSError) or "expected" in sentence


def test_what_is_in_range_is_not_refused():
    for name, allowed in RANGES.items():
        for value in (allowed.low, allowed.high, *allowed.also):
            require_stated(**{name: value})
        number = np.int64 if allowed.whole else np.float64
        require_stated(**{name: number(allowed.low)})
    for shape in SHAPES.values():
        for p in shape.parameters:
            # Those that replace others come together.
            with_it = (
                {}
                if p in shape.needed
                else {q.name: 2.0 for q in shape.parameters if q not in shape.needed}
            )
            for value in (p.allowed.low, p.allowed.high, *p.allowed.also) if p.allowed else ():
                Particles.of(shape, **(with_it | {p.name: value}))
