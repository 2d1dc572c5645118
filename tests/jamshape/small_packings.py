"""Small packings at an energy, made once a session; a synthetic matrix; exact eigenvalues."""

from functools import cache
from types import SimpleNamespace

import mpmath
import numpy as np
import scipy.sparse
from squeezed import quickly_squeezed

from jamshape.landscape import Landscape
from jamshape.minima import Residual
from jamshape.minima.target import Target, find
from jamshape.vibration.hessian import DynamicalMatrixOptions, dynamical_matrix
from jamshape.vibration.spectrum import spectrum

# n, alpha, packing fraction just below jamming, seed
SMALL = {
    "discs": (16, 0, 0.77, 1),
    "rods of alpha 0.01": (16, 0.01, 0.77, 1),
    "rods of alpha 1": (16, 1, 0.86, 1),
    "rods of alpha 4": (16, 4, 0.8, 1),
}

DIGITS = 60


@cache
def jammed(name, u0=1e-15):
    """Landscape and minimum."""
    packing, state = quickly_squeezed(*SMALL[name])
    landscape = Landscape(packing)
    return landscape, find(landscape, state, Target(u0))


@cache
def matrix_of(name, u0=1e-15):
    landscape, minimum = jammed(name, u0)
    return dynamical_matrix(landscape, minimum.state)


@cache
def sliding():
    """The first small packing of rods in which some slide, and its matrix.

    Which packing a start leads to depends on the last digits; some of each few have rods that slide.
    """
    for seed in range(1, 20):
        packing, state = quickly_squeezed(16, 4, 0.8, seed)
        landscape = Landscape(packing)
        minimum = find(landscape, state, Target(1e-15))
        matrix = dynamical_matrix(landscape, minimum.state)
        found = spectrum(matrix)
        values = np.abs(found.eigenvalues[~found.is_translation])
        if not 1e-16 < values.min() < 1e-12:  # an even smaller one is rounding
            continue
        softest = int(np.abs(found.eigenvalues + found.is_translation).argmin())
        if keeps_its_bonds(landscape, minimum.state, matrix, found.vectors[:, softest]):
            return landscape, minimum, matrix
    raise AssertionError


def keeps_its_bonds(landscape, state, matrix, mode):
    """Whether rods slide this far along a mode before they leave each other."""
    force = DynamicalMatrixOptions(force=True)
    for step in (1e-5, -1e-5):
        try:
            there = state.displaced(*matrix.coordinates.motion(step * mode))
            if dynamical_matrix(landscape, there, force).n_bonds != matrix.n_bonds:
                return False
        except ValueError:  # no bond is left
            return False
    return True


def second_order(matrix):
    """The size of eigenvalues that are of second order in the prestress."""
    return abs(matrix.prestress).max() ** 2


def synthetic(n=36, m=30, size=1e-8, n_sliding=2, seed=0):
    """M = C^T C - S with null modes of C, some of which S moves in second order only."""
    rng = np.random.default_rng(seed)
    C = rng.normal(size=(m, n)) / np.sqrt(n)
    null = np.linalg.svd(C)[2][m:].T
    S = size * rng.normal(size=(n, n))
    S = S + S.T
    P, Q = null @ null.T, null[:, :n_sliding] @ null[:, :n_sliding].T
    S = S - P @ S @ Q - Q @ S @ P + Q @ S @ Q
    return as_matrix(C, 0.5 * (S + S.T))


def as_matrix(C, S, translations=None):
    """Dynamical matrix as `modes` requires it."""
    n = C.shape[1]
    C, S = map(scipy.sparse.csr_matrix, (C, S))
    return SimpleNamespace(
        compatibility=C,
        prestress=S,
        prestress_sizes=abs(S),
        prestress_rounding=0 * abs(S),
        stiffness=C.T @ C,
        matrix=C.T @ C - S,
        translations=np.zeros((n, 0)) if translations is None else translations,
        residual=Residual(0.0, 0.0),
        size=n,
        n_bonds=C.shape[0],
    )


def exact_eigenvalues(matrix, digits=DIGITS):
    """Ascending, of the matrix as it is stored, in arbitrary precision."""
    with mpmath.workdps(digits):
        C = mpmath.matrix(matrix.compatibility.toarray().tolist())
        S = mpmath.matrix(matrix.prestress.toarray().tolist())
        values = mpmath.eigsy(C.T * C - S, eigvals_only=True)
        return sorted(values)


def errors(found, exact, digits=DIGITS):
    """Errors of ascending eigenvalues (k,), in double but without cancellation."""
    with mpmath.workdps(digits):
        pairs = zip(found.tolist(), exact, strict=True)
        return np.array([float(abs(mpmath.mpf(a) - b)) for a, b in pairs])
