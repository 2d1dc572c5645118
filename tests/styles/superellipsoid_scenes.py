"""Packings of superellipsoids for the tests of the styles."""

from __future__ import annotations

import sys

from lammps_runs import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "analysis" / "stability"))

from battery.scenes import superellipsoids
from battery.scenes.superellipsoids import KINDS, particles, tiny_box
from battery.shapes.superellipsoids import CROWDS

__all__ = ["CROWDS", "crowd", "particles", "tiny_box"]


def crowd(dimension=3, kinds=(0, 1, 2, 3), **named):
    return superellipsoids.crowd(dimension, [KINDS[k] for k in kinds], **named)
