"""Our decks, run as their users run them, and what they leave."""

from __future__ import annotations

import contextlib
from pathlib import Path

import numpy as np
from lammps_runs import QUIET, REPOSITORY, environment, start_lmp

INPUTS = REPOSITORY / "inputs"

SMALL = {
    "compress_spherocylinder": {"n": 32, "alpha": 2, "kappa": 1e-3, "dt": 0.1, "phi_end": 0.95},
    # Fast and coarse; ends at phi_end, or where the pressure says so.
    "compress_superellipsoid": {
        "n": 24, "p": 1.5, "kappa": 4e-4, "w1": 0.8, "w2": 1.2, "phi_end": 0.7, "p_end": 1.0,
    },
    # To a strain of 0.7, with a flip of the box at 0.5.
    "shear_spherocylinder": {
        "n": 32, "alpha": 2, "gdot": 1e-3, "strain": 0.7, "phi_end": 0.9, "sides": "two",
        "rows": 14, "frames": 7,
    },
    "minimize_spherocylinder": {"maxiter": 10},
    "minimize_superellipsoid": {"maxiter": 10},
}  # fmt: skip

DRIVEN = ("log", "dump", "contacts.dump", "restart", "restart.1", "restart.2")
LEFT = {
    "compress_spherocylinder": DRIVEN,
    "compress_superellipsoid": (*DRIVEN, "data"),
    "shear_spherocylinder": DRIVEN,
    "minimize_spherocylinder": ("log", "restart", "data"),
    "minimize_superellipsoid": ("log", "restart", "data"),
}
"""Ends of the names of the files that a deck leaves."""


def words_of(**settings):
    return [str(word) for name, value in settings.items() for word in ("-var", name, value)]


def start_deck(name, cwd, ranks=1, *, inputs=INPUTS, environment=environment, **settings):
    """Run a deck with small settings and these in a folder; return how it ended."""
    settings = {"jamshape": inputs.parent} | SMALL[name] | settings
    words = [*QUIET, "-in", inputs / f"{name}.in", *words_of(**settings)]
    return start_lmp(*words, cwd=cwd, ranks=ranks, env=environment())


def run_deck(name, cwd, ranks=1, **settings):
    """Run a deck to its end; return what it said."""
    done = start_deck(name, cwd, ranks, **settings)
    assert done.returncode == 0, done.stdout[-3000:]
    warnings = [line for line in done.stdout.splitlines() if "WARNING" in line]
    assert all("Restart file used different # of processors" in line for line in warnings), warnings
    return done.stdout


def thermo(path):
    """Columns of the last kind of thermo output in a log, by name without v_; of rows that stand twice the last."""
    names, rows = [], {}
    for line in Path(path).read_text().splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            names, rows = words, rows if words == names else {}
        elif names and len(words) == len(names) and words[0].isdigit():
            with contextlib.suppress(ValueError):  # a line that was cut short
                rows[int(words[0])] = [float(word) for word in words]
    table = np.array([rows[step] for step in sorted(rows)])
    return dict(zip((name.removeprefix("v_") for name in names), table.T, strict=True))
