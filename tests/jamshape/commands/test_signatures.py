"""Options made from signatures and docstrings: they offer what the functions know, and pass on what was typed."""

import inspect
import re
import subprocess
import sys
from pathlib import Path

import pytest

import jamshape as js
from jamshape.commands import options_of
from jamshape.commands.signatures import called, given, parser_for
from jamshape.flow import implicit
from jamshape.flow.motion import INTEGRATORS
from jamshape.flow.shear import FLOWS
from jamshape.minima import METHODS
from jamshape.protocols.defaults import PROTOCOLS
from jamshape.protocols.recipe import SEARCHES

FUNCTIONS = {
    "compress": js.compress,
    "slow": js.slow_compress,
    "shear": js.shear,
    "aqs": js.quasistatic_shear,
    "pack": js.make_packing,
}
CHOICES = [
    ("slow", "method", implicit.METHODS),
    ("shear", "flow", FLOWS),
    ("aqs", "flow", FLOWS),
    ("pack", "dimension", [2, 3]),
    ("pack", "protocol", [*PROTOCOLS, "1", "2"]),
    ("pack", "search", SEARCHES),
    ("pack", "minimiser", METHODS),
]


def actions(command):
    return {action.dest: action for action in options_of(command)._actions if action.help != "==SUPPRESS=="}  # fmt: skip


@pytest.mark.parametrize("command", FUNCTIONS)
def test_every_argument_but_progress_has_an_option_with_a_help(command):
    known = actions(command)
    names = set(inspect.signature(FUNCTIONS[command]).parameters) - {"particles", "progress"}
    pair = {"phi"} if "phi_end" in known and "phi" in names else set()
    expected = names - pair - {"file"} | {"out"} | ({"phi_start", "phi_end"} if pair else set())
    assert expected <= known.keys()
    assert all(known[name].help for name in expected)


@pytest.mark.parametrize(("command", "name", "table"), CHOICES)
def test_choices_are_those_that_the_function_knows(command, name, table):
    assert set(actions(command)[name].choices) == set(table)


@pytest.mark.parametrize("command", ["compress", "shear"])
def test_help_of_an_integrator_tells_all(command):
    others = implicit.METHODS if command == "shear" else ()
    told = re.findall(r"[\w/-]+", actions(command)["integrator"].help)
    assert {*INTEGRATORS, *others} <= set(told)


def numbers(text):
    return {float(number) for number in re.findall(r"\d+\.?\d*(?:e-?\d+)?", text)}


@pytest.mark.parametrize("name", sorted({name for one in PROTOCOLS.values() for name in one.usual}))
def test_help_of_a_packing_tells_the_defaults_of_all_protocols(name):
    told = actions("pack")[name].help
    for protocol in PROTOCOLS.values():
        values = {table[name] for table in (protocol.usual, protocol.in_plane) if name in table}
        assert {v for v in values if isinstance(v, int | float)} <= numbers(told), told
        assert all(v in told for v in values if isinstance(v, str)), told


def test_commands_work_without_docstrings(tmp_path):
    out = tmp_path / "new.h5"
    words = ["pack", "--alpha", "1", "--n", "16", "--u0", "1e-6", "--protocol", "1", "--phi-start", "0.55"]  # fmt: skip
    command = [sys.executable, "-OO", "-m", "jamshape", *words, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, out.exists()) == (0, True), done.stderr


def stirred(
    particles: js.Particles,
    *,
    phi: tuple[float, float] = (0.4, 0.9),
    start: js.Packing | str | Path | None = None,
    mode: str = "near",
    n: int | None = None,
    is_hot: bool = False,
    file: str | Path | None = None,
    progress: bool = True,
) -> tuple[js.Particles, dict[str, object]]:
    """Stir.

    Parameters
    ----------
    particles : Particles
    phi : (float, float)
        Packing fraction of the start, and final packing fraction.
    start : Packing or path, optional
        Initial packing, or file; 100 % of it.
    mode : {"near", "far"}
        Where to stir with `n`. The rest
        follows.
    n : int, optional
    is_hot : bool
        Whether ``heated``.
    file, progress
        See `compress`.

    Returns
    -------
    tuple
    """
    assert progress
    return particles, {"phi": phi, "start": start, "mode": mode, "n": n, "is_hot": is_hot, "file": file}  # fmt: skip


def typed(words):
    return parser_for(stirred, "Stir.").parse_args(words.split())


def test_what_was_typed_is_passed_on():
    words = "--alpha 2 --phi-end 0.8 --start a.h5 --mode far --n 3 --is-hot --out b.h5"
    particles, found = called(stirred, typed(words), is_hot=False)
    assert particles.told["alpha"] == 2
    assert found == {
        "phi": (0.4, 0.8), "start": Path("a.h5"), "mode": "far", "n": 3, "is_hot": False,
        "file": Path("b.h5"),
    }  # fmt: skip


def test_what_was_not_typed_is_not():
    assert given(stirred, typed("--out b.h5")) == {"file": Path("b.h5")}


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("", "required: --out"),
        ("--out b --mode middle", "argument --mode: invalid choice: 'middle'"),
        ("--out b --n 1.5", "argument --n: invalid int value: '1.5'"),
        ("--out b --progress", "unrecognized arguments: --progress"),
    ],
)
def test_other_words_are_refused(words, said, capsys):
    with pytest.raises(SystemExit) as end:
        typed(words)
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_the_help_is_the_text_of_the_docstring():
    told = " ".join(parser_for(stirred, "Stir.").format_help().split())
    for line in (
        "--phi-start PHI_START packing fraction of the start (0.4) ",
        "--phi-end PHI_END final packing fraction (0.9) ",
        "--start START initial packing, or file; 100 % of it ",
        "--mode {near,far} where to stir with --n (near). The rest follows ",
        "--is-hot whether heated ",
        "--out OUT H5MD file to write",
    ):
        assert line in told
