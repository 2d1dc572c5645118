"""The commands of pages in docs/how-to, in their order, with options behind them that make them quick."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from jamshape.commands import COMMANDS

pytestmark = pytest.mark.lammps

PAGES = Path(__file__).parents[3] / "docs" / "how-to"
PAGE = (PAGES / "command.md").read_text(encoding="utf-8")
OF_COMMAND = re.compile(r"^    jamshape (.*)$", re.MULTILINE)
LINES = OF_COMMAND.findall(PAGE)

SMALL = "--n 16 --phi-start 0.55 --u0 1e-6"
QUICK = {
    "compress": "--alpha 1 --n 16 --kappa 1e-3 --rows 20 --frames 4",
    "pack": f"--alpha 1 {SMALL}",
    "slow": "--alpha 1 --n 16 --phi-start 0.7 --phi-end 0.72 --kappa 1e-6",
    "sweep": f"--alpha 1 --samples 1 {SMALL}",
    "draw": "--dpi 50",
}


def test_every_command_is_on_the_page():
    assert {line.split()[0] for line in LINES} == set(COMMANDS)
    assert re.findall(r"^\*\*(\w+)\*\* ", PAGE, re.MULTILINE) == list(
        dict.fromkeys(line.split()[0] for line in LINES)
    )


def test_the_commands_of_the_page_run_in_their_order(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for line in LINES:
        name, *options = shlex.split(line)
        out = options[options.index("--out") + 1] if "--out" in options else None
        needed = {".gsd": "gsd", ".ovito": "ovito"}.get(Path(out or "").suffix)
        if needed and not importlib.util.find_spec(needed):
            continue
        ended = jamshape(name, *options, *QUICK.get(name, "").split())
        assert not ended.code, f"{line}: {ended}"
        assert out is None or Path(out).exists()


RODS, BALLS = "--n 16 --alpha 1", "--n 16 --delta-phi 0.02 --tolerance 1e-1"
OF_PROTOCOLS = {
    "--search halving": "--u0 1e-6 --accuracy 0.1 --tolerance 1e-2",
    "--start": "--u0 1e-6",
    "marschall-2018": f"{RODS} --phi-start 0.55 --kappa 1e-4 --u0 1e-6",
    "yuan-2019-1": f"{BALLS} --phi-start 0.3",
    "yuan-2019-2": f"{BALLS} --phi-start 0.3 --n-sweeps 20",
    "slow": f"{RODS} --phi-start 0.8 --kappa 1e-5 --phi-end 0.95",
}
"""What makes a command quick that has these words; the first that fits."""


def test_the_commands_of_protocols_run_in_their_order(jamshape, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    lines = OF_COMMAND.findall((PAGES / "protocols.md").read_text(encoding="utf-8"))
    fitting = [next(words for words in OF_PROTOCOLS if words in line) for line in lines]
    assert set(fitting) == set(OF_PROTOCOLS)
    for line, words in zip(lines, fitting, strict=True):
        ended = jamshape(*shlex.split(line), *OF_PROTOCOLS[words].split())
        # The paper's minimiser may end before forces balance as well as ours do.
        may_fail = "--minimiser" in line
        assert not ended.code or (may_fail and ended.code == 1), f"{line}: {ended}"
