"""The commands of docs/how-to/command.md, in their order, with options behind them that make them quick."""

import importlib.util
import re
import shlex
from pathlib import Path

import pytest

from jamshape.commands import COMMANDS

pytestmark = pytest.mark.lammps

PAGE = (Path(__file__).parents[3] / "docs" / "how-to" / "command.md").read_text(encoding="utf-8")
LINES = re.findall(r"^    jamshape (.*)$", PAGE, re.MULTILINE)

SMALL = "--n 16 --kappa 1e-5 --p-end 3e-4 --phi-start 0.55 --u0 1e-6"
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
