"""Frame, dimension and shape of a file with particles, beside each argument that takes one."""

import pytest

import jamshape as js
from jamshape.checks import ArgumentError
from jamshape.commands.signatures import called, parser_for
from jamshape.files.h5md import read_attributes, read_packing

DIMERS = js.Packing.of(
    "dimer", [[0.5, 0.5], [1.6, 1.6]], [0.3, 1.0], box=[2.2, 2.2], alpha=1, size=[1.0, 1.1]
)
FRAMES = [DIMERS, DIMERS.with_(step=3, position=DIMERS.position + [[0, 0], [0, 0.01]])]
SHORT = "--step 1e-3 --strain 1e-3"

STARTED = (js.shear, js.cyclic_shear, js.slow_compress, js.quasistatic_shear)
TAKING = (js.modes, js.minimise, js.ladder)


@pytest.fixture
def dump(tmp_path):
    """A dump of two frames, which does not state that particles are dimers."""
    path = tmp_path / "two.dump"
    js.save(path, js.Frames(FRAMES) if hasattr(js, "Frames") else FRAMES[0])
    return path


def run(function, words, *more):
    options = parser_for(function, "").parse_args([*map(str, more), *words.split()])
    return called(function, options, progress=False)


@pytest.mark.parametrize("function", [*STARTED, *TAKING])
def test_every_function_that_takes_particles_has_the_options(function):
    known = set(
        vars(
            parser_for(function, "").parse_args(["p.h5"] * (function in TAKING) + ["--out", "a.h5"])
        )
    )
    assert known >= {"frame", "dimension", "shape"}
