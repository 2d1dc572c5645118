"""Whether a packing reached its goal, and how that is said in Python and by commands."""

import pickle
import sys
import warnings

import pytest

import jamshape as js
from jamshape.checks import ArgumentError, require_no_effect
from jamshape.command import sentences
from jamshape.files.outcomes import is_reached, shortfall, warn_unless_reached

STALLED = {"outcome": "stalled", "residual": 3e-6, "tolerance": 1e-8}


@pytest.mark.parametrize(
    ("known", "expected"),
    [
        ({"outcome": "converged"}, True),
        ({"outcome": "kink"}, True),
        ({"outcome": "stalled"}, False),
        ({"outcome": "exhausted"}, False),
        ({"outcome": "unjammed"}, False),
        ({"outcome": "sliding"}, False),  # nobody knows how far
        ({"outcome": "sliding", "residual": 2e-8, "tolerance": 1e-8}, False),
        ({"outcome": "sliding", "residual": 2e-9, "tolerance": 1e-8}, True),
        ({"outcome": "sliding", "residual_force": 1e-9, "residual_torque": 2e-8, "tolerance": 1e-8}, False),
        ({"outcome": "converged", "strict": True, "n_negative": 0}, True),
        ({"outcome": "converged", "strict": True, "n_negative": 1}, False),
    ],
)  # fmt: skip
def test_goals(known, expected):
    assert is_reached(known) is expected
    assert bool(shortfall(known)) is not expected


def test_what_falls_short_is_a_warning_with_what_to_try():
    with pytest.warns(
        js.NotReachedWarning, match="ended stalled, with net forces up to 3e-06"
    ) as said:
        warn_unless_reached(STALLED, stacklevel=1)
    (one,) = said
    assert one.filename == __file__
    assert str(one.message).endswith(
        "expected at most 1e-08; try strict=True, another u0 or another seed"
    )
    again = pickle.loads(pickle.dumps(one.message))  # as from a worker process
    assert again.with_options.endswith("try --strict, another --u0 or another --seed")
    with pytest.warns(
        js.NotReachedWarning, match="2 of its modes .* try another u0 or another seed"
    ):
        warn_unless_reached({"outcome": "converged", "strict": True, "n_negative": 2})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_unless_reached({"outcome": "kink"})


@pytest.mark.parametrize("code", [None, 0, 1, "text"])
def test_a_command_that_fell_short_does_not_end_with_success(code, capsys):
    def command():
        with sentences("jamshape pack"):
            warn_unless_reached(STALLED)
            sys.exit(code)

    with pytest.raises(SystemExit) as end:
        command()
    assert end.value.code == (code or 1)
    assert capsys.readouterr().err.startswith(
        "jamshape pack: warning: the packing is not at rest: it ended stalled"
    )


def test_a_command_names_what_was_typed():
    with pytest.raises(SystemExit) as end, sentences("jamshape shear"):
        require_no_effect("start", "run.h5", n=None, phi_start=0.7)
    assert end.value.code == (
        "jamshape shear: --phi-start 0.7 has no effect with --start run.h5, expected one of them; leave the other out"
    )
    error = ArgumentError("{file} is not there", {"file": "typo.h5"})
    assert str(pickle.loads(pickle.dumps(error))) == "file='typo.h5' is not there"
    assert error.with_options == "--out typo.h5 is not there"
