"""Particles that many tests are made of."""

import numpy as np

from jamshape.shapes.particles import Particles

ROD = "spherocylinder"


def bidisperse(alpha=4.0, size_ratio=1.4):
    """Small and big spherocylinders, 1:1."""
    return Particles.of(ROD, size_ratio, alpha=alpha)


def monodisperse(alpha):
    return Particles.of(ROD, 1.0, alpha=alpha)


def of_arrays(half_length, radius, species=None):
    A, R = np.asarray(half_length, float), np.asarray(radius, float)
    return Particles.given(ROD, np.column_stack([2 * (A + R), 2 * R, 2 * R]), species=species)


def superellipsoids(p=1.0, w1=1.0, w2=1.0):
    return Particles.of("superellipsoid", exponent=p, w1=w1, w2=w2)
