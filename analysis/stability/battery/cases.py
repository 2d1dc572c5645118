"""All cases of the stability battery, for `stability_report.py` and the tests."""

from __future__ import annotations

from dataclasses import replace

from battery.case import Case
from battery.parts import (
    flow,
    implicit,
    lammps_minimize,
    landscape,
    minimisers,
    pair_style,
    pairs_of_rods,
    pairs_of_superellipsoids,
    quasistatic,
    spectra,
    starts,
    targets,
    thermal,
    two_ranks,
)

PARTS = (
    pairs_of_rods,
    pairs_of_superellipsoids,
    landscape,
    pair_style,
    flow,
    lammps_minimize,
    two_ranks,
    minimisers,
    targets,
    spectra,
    starts,
    implicit,
    quasistatic,
    thermal,
)

# Ten thousand images for each of its pairs.
HEAVY = "3D, alpha 1e-6 to 100"


def all_cases() -> list[Case]:
    """List all cases, part by part."""
    cases = [case for part in PARTS for case in part.cases()]
    cases = [replace(case, heavy=case.heavy or HEAVY in case.name) for case in cases]
    labels = [case.label for case in cases]
    assert len(set(labels)) == len(labels), "a case is there twice"
    return cases
