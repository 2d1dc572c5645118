"""No call of the compiled module ends its process, whatever it is given and in whatever order."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).with_name("fuzzed_bindings.py")
ROUNDS = 60


def fuzzed(seed, rounds):
    """Number of calls of each name that returned and were refused, in a process that survived."""
    done = subprocess.run(
        [sys.executable, PROGRAM, str(seed), str(rounds)],
        capture_output=True, text=True, timeout=600, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    rows = (line.rsplit(" ", 2) for line in done.stdout.splitlines())
    return {name: (int(returned), int(refused)) for name, returned, refused in rows}


def test_bindings_survive_what_they_do_not_expect():
    calls = fuzzed(1, ROUNDS)
    assert calls.keys() >= {
        "deform",
        "counts_of_team",
        "sums",
        "solve_stage",
        "mixed_gradient",
        "descend",
        "find_rattlers",
    }
    assert all(returned for returned, _ in calls.values())
    assert sum(refused for _, refused in calls.values()) > 5 * ROUNDS


@pytest.mark.validate
@pytest.mark.parametrize("seed", range(2, 12))
def test_so_they_do_for_long(seed):
    assert fuzzed(seed, 10 * ROUNDS)
