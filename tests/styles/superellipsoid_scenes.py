"""Packings of superellipsoids for the tests of the styles."""

import extreme_superellipsoids
from extreme_shapes import CROWDS
from extreme_superellipsoids import KINDS, particles, tiny_box

__all__ = ["CROWDS", "crowd", "particles", "tiny_box"]


def crowd(dimension=3, kinds=(0, 1, 2, 3), **named):
    return extreme_superellipsoids.crowd(dimension, [KINDS[k] for k in kinds], **named)
