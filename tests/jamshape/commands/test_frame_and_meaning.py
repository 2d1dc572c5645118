"""Frame, dimension and shape of a file with particles, beside each argument that takes one."""

import re
import warnings

import numpy as np
import pytest

import jamshape as js
from jamshape.checks import ArgumentError
from jamshape.commands.signatures import called, parser_for
from jamshape.files.lammps_text import write_dump

DIMERS = js.Packing.of(
    "dimer", [[0.5, 0.5], [1.6, 1.6]], [0.3, 1.0], box=[2.2, 2.2], alpha=1, size=[1.0, 1.1]
)
FRAMES = [DIMERS, DIMERS.with_(step=3, position=DIMERS.position + np.array([[0, 0], [0, 0.01]]))]
FIRST = "--shape dimer --dimension 2 --frame 0"

STARTED = (js.shear, js.cyclic_shear, js.slow_compress, js.quasistatic_shear)
TAKING = (js.modes, js.minimise, js.ladder)


@pytest.fixture
def dump(tmp_path):
    """A dump of two frames, which does not state that particles are dimers."""
    write_dump(tmp_path / "two.dump", FRAMES)
    return tmp_path / "two.dump"


def typed(function, path, words, **more):
    """Call a function with what was typed beside the file, as its command does."""
    where = [str(path)] if function in TAKING else ["--start", str(path)] if path else []
    options = parser_for(function, "").parse_args([*where, *words.split()])
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # nothing is guessed
        return called(function, options, **more)


@pytest.mark.parametrize("function", [*STARTED, *TAKING])
def test_the_options_stand_beside_every_file_with_particles(function, dump):
    parser = parser_for(function, "")
    words = [str(dump)] * (function in TAKING) + ["--out", "a.h5"] * (function is not js.modes)
    assert vars(parser.parse_args(words)).keys() >= {"frame", "dimension", "shape"}


@pytest.mark.parametrize(("frame", "k"), [("0", 0), ("1", 1), ("-1", 1)])
def test_a_run_starts_from_the_frame_with_the_meaning_that_was_typed(dump, tmp_path, frame, k):
    words = f"--step 1e-3 --strain 1e-3 --shape dimer --dimension 2 --frame {frame} --out {tmp_path / 'a.h5'}"
    first = typed(js.quasistatic_shear, dump, words, progress=False).packing(0)
    assert first.shape_style == "dimer"
    assert first.position == pytest.approx(FRAMES[k].position, abs=1e-12)


def test_modes_and_minima_are_those_of_the_frame(dump, tmp_path):
    with pytest.raises(ValueError, match="all 2 particles are rattlers"):
        typed(js.modes, dump, f"{FIRST} --force")
    found = typed(js.minimise, dump, f"{FIRST} --out {tmp_path / 'm.h5'}", progress=False)
    assert found.shape_style == "dimer"
    assert found.position == pytest.approx(DIMERS.position, abs=1e-12)


def test_another_frame_is_another_run(dump, tmp_path):
    words = f"--step 1e-3 --strain 1e-3 --shape dimer --out {tmp_path / 'a.h5'} --frame "
    typed(js.quasistatic_shear, dump, f"{words} 0", progress=False)
    typed(js.quasistatic_shear, dump, f"{words} -2", progress=False)  # is the same, and done
    with pytest.raises(ArgumentError, match="a quasistatic shear with start="):
        typed(js.quasistatic_shear, dump, f"{words} 1", progress=False)


@pytest.mark.parametrize(
    ("function", "has_start", "words", "said"),
    [
        (js.shear, True, f"{FIRST} --alpha 4", "--particles .* has no effect with --start .*two.dump"),
        (js.shear, True, f"{FIRST} --n 4", "--n 4 has no effect with --start .*two.dump"),
        (js.quasistatic_shear, False, "--frame 0", "--frame 0 has no effect without --start"),
        (js.cyclic_shear, True, "--shape dimer --frame 2", "has 2 frames, expected frame 2"),
    ],
)  # fmt: skip
def test_what_contradicts_a_start_or_lacks_one_is_refused(
    dump, tmp_path, function, has_start, words, said
):
    with pytest.raises(ValueError, match="expected") as error:
        typed(function, dump if has_start else None, f"{words} --out {tmp_path / 'no.h5'}")
    assert re.search(said, getattr(error.value, "with_options", str(error.value)))


@pytest.mark.parametrize("function", STARTED)
def test_a_file_that_states_another_shape_is_not_reread(tmp_path, function):
    DIMERS.save(tmp_path / "dimers.h5")
    with pytest.raises(ValueError, match="has shape dimer, expected superellipsoid"):
        typed(
            function, tmp_path / "dimers.h5", f"--shape superellipsoid --out {tmp_path / 'no.h5'}"
        )
