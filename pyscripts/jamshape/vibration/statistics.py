"""Statistics of the modes of a packing: densities, participation, directions, bands and their counts.

Marschall & Teitel 2018, Sec. III D.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arrays import FloatArray, IntArray
from jamshape.contacts.rattlers import GRAZING
from jamshape.packing import Packing
from jamshape.vibration.dense_modes import rank_of, rank_tolerance
from jamshape.vibration.hessian import Coordinates, DynamicalMatrix
from jamshape.vibration.spectrum import Spectrum

# The gap below the high band is the widest within this fraction of all modes around the rank of H.
_NEAR_RANK = 0.002
_NEAR_RANK_MODES = 3  # that fraction in modes, at least

# At full rank, bonds in excess of this fraction of the modes leave no band.
_EXCESS = 0.02

# Bands separate if eigenvalues on both sides of their gap differ by this factor, the same that
# `jamshape.vibration.dense_modes` requires of modes held by stiffness alone.
_GAP = 3.0

# Bonds with a larger share than this in further states of self stress belong to them.
_SHARE = 1e-3

# Singular values are computed for up to this number of bonds or coordinates, in a second.
_DENSE = 1500


class Components(NamedTuple):
    """Shares of the kinds of motion in each mode; (k,) each, their sum is 1."""

    parallel: FloatArray
    """Displacement along the long axis (Marschall & Teitel 2018, Eq. 33)."""
    perpendicular: FloatArray
    """Displacement perpendicular to it (Eq. 34)."""
    rotation: FloatArray
    """(Eq. 35)"""
    of_round: FloatArray
    """Displacement of particles without long axis, discs."""


class Density(NamedTuple):
    """Density of vibrational states in logarithmic bins."""

    edges: FloatArray
    """(B + 1,) bin edges in omega, ascending."""
    n_modes: IntArray
    """(B,)"""
    density: FloatArray
    """(B,) normalised to integral 1 over all counted modes."""

    @property
    def omega(self) -> FloatArray:
        """(B,) geometric bin centres."""
        return np.sqrt(self.edges[1:] * self.edges[:-1])


class Band(NamedTuple):
    """Modes between two gaps, by magnitude of their eigenvalues."""

    name: str
    """``low`` (of second order in the prestress), ``middle`` (of first order) or ``high`` (constrained by bonds)."""
    modes: IntArray
    """Rows of the spectrum."""
    n_negative: int
    n_unsure: int
    """Modes whose sign is within the error."""
    mean_omega: float
    """Mean frequency of modes with definitely positive eigenvalues; NaN if there is none."""
    gap_below: float
    """Smallest |lambda| of the band over the largest of the band below; inf if there is none."""

    @property
    def n_modes(self) -> int:
        """Number of modes."""
        return len(self.modes)


class Counts(NamedTuple):
    """Counts of modes and bonds; n_modes = n_translations + n_floppy + rank."""

    n_modes: int
    n_translations: int
    n_bonds: int
    rank: int
    """Rank of H, from the singular values of C."""
    n_self_stress: int
    """N_c - rank, which is one, and one more for each set of redundant bonds. The one is missing where rods overlap by more than
    A^2 / d: ends of a contact then share an energy that depends on more than the lengths of its bonds."""
    n_floppy: int
    """Modes but translations that H leaves free."""
    n_grazing: int
    """Grazing bonds, such as those that stop sliding rods."""
    high_expected: float
    """N z / 2 = N_c (Marschall & Teitel 2018, Sec. III D)."""
    low_expected: float
    """N (z_iso - z) / 2 = n_modes - N_c, including translations."""
    softest_constraint: float
    """Smallest singular value counted in the rank."""
    largest_of_self_stress: float
    """Largest singular value not counted in the rank."""


class Redundancy(NamedTuple):
    """A set of bonds that can carry stress by itself, beside that of the packing.

    Examples are a ring of rods with flat contacts, or a second bond of vanishing force.
    """

    n_states: int
    bonds: IntArray
    """Rows of the compatibility matrix."""
    particles: IntArray
    """Rows of the packing."""
    largest_singular_value: float
    """Largest singular value of C; 0 means exactly redundant."""


def participation(coordinates: Coordinates, vectors: FloatArray) -> FloatArray:
    """Participation ratio of modes (Marschall & Teitel 2018, Eq. 32).

    (sum u^2)^2 / (N sum u^4) over all components u: 3 for a mode spread evenly over x, y and A theta of N
    particles (2 for discs), 1/N for one that moves a single coordinate.

    Parameters
    ----------
    coordinates : Coordinates
    vectors : (n, k) array of float64

    Returns
    -------
    (k,) array of float64
    """
    squares = vectors**2
    n = len(coordinates.backbone)
    return np.asarray(squares.sum(axis=0) ** 2 / (n * (squares**2).sum(axis=0)))


def components(coordinates: Coordinates, packing: Packing, vectors: FloatArray) -> Components:
    """Split modes into displacement along and across the particles and rotation.

    Parameters
    ----------
    coordinates : Coordinates
    packing : Packing
        Particles without direction (`Packing.directors`) count as round.
    vectors : (n, k) array of float64
        Unit columns.

    Returns
    -------
    Components
    """
    D = coordinates.dimension
    axes = packing.directors[coordinates.backbone]
    is_round = np.isnan(axes[:, 0])
    moves = ~coordinates.is_rotation
    shift = vectors[moves].reshape(len(axes), D, -1)
    square = (shift**2).sum(axis=1)
    along = np.einsum("id,idk->ik", np.nan_to_num(axes), shift) ** 2
    return Components(
        parallel=along[~is_round].sum(axis=0),
        perpendicular=(square - along)[~is_round].sum(axis=0),
        rotation=(vectors[~moves] ** 2).sum(axis=0),
        of_round=square[is_round].sum(axis=0),
    )


def density_of_states(omega: FloatArray, per_decade: int = 10) -> Density:
    """Count frequencies in logarithmic bins (Marschall & Teitel 2018, Sec. III D).

    Parameters
    ----------
    omega : (k,) array of float64
        Non-positive ones, unstable modes and translations, are left out.
    per_decade : int

    Returns
    -------
    Density
        Without bins if there is no frequency.
    """
    positive = omega[omega > 0]
    if not len(positive):
        return Density(np.ones(1), np.zeros(0, np.int64), np.zeros(0))
    low, high = np.log10(positive.min()), np.log10(positive.max())
    first, last = np.floor(low * per_decade), np.floor(high * per_decade) + 1
    edges = 10.0 ** (np.arange(first, last + 1) / per_decade)
    edges[0], edges[-1] = min(edges[0], positive.min()), np.nextafter(edges[-1], np.inf)
    count = np.histogram(positive, edges)[0].astype(np.int64)
    return Density(edges, count, count / (len(positive) * np.diff(edges)))


def mean_in_bins(values: FloatArray, omega: FloatArray, edges: FloatArray) -> FloatArray:
    """Average (k,) values over the modes in bins of frequency: (B,), NaN in empty bins."""
    count = np.histogram(omega, edges)[0]
    total = np.histogram(omega, edges, weights=values)[0]
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def count(matrix: DynamicalMatrix, found: Spectrum) -> Counts:
    """Count modes and constraints; `found` is a whole spectrum with singular values."""
    rank = found.rank(matrix.residual.largest)
    sigma, n_moves = found.singular_values, matrix.translations.shape[1]
    force = matrix.contacts["bond_force"]
    n_grazing = int(((force > 0) & (force < GRAZING * matrix.bond_force)).sum())
    return Counts(
        n_modes=matrix.size,
        n_translations=n_moves,
        n_bonds=matrix.n_bonds,
        rank=rank,
        n_self_stress=matrix.n_bonds - rank,
        n_floppy=matrix.size - n_moves - rank,
        n_grazing=n_grazing,
        high_expected=matrix.n_particles * matrix.z / 2,
        low_expected=matrix.size - matrix.n_particles * matrix.z / 2,
        softest_constraint=float(sigma[rank - 1]) if rank else np.nan,
        largest_of_self_stress=float(sigma[rank]) if rank < len(sigma) else 0.0,
    )


class Constraints(NamedTuple):
    """Rank of the compatibility matrix C of m bonds and n coordinates."""

    n_bonds: int
    """Number of bonds m."""
    rank: int
    n_self_stress: int
    """Number of states of self stress, m - rank."""
    n_zero_modes: int
    """Motions that change no bond length, n - rank, translations, free spins and rattlers among them."""
    method: str
    """``svd``, all singular values of K^(1/2) C; or ``pivots``, above 1500 bonds and coordinates, their number above the tolerance, by
    Sylvester's law of inertia, from the signs of the pivots of a sparse factorisation."""


def constraints(weighted: Any, residual: float) -> Constraints:
    """Find the rank of K^(1/2) C, a sparse (m, n) matrix, in comparable units of displacements and rotations.

    Raises
    ------
    ValueError
        If pivots do not determine it.
    """
    m, n = weighted.shape
    if m == 0 or n == 0:
        return Constraints(m, 0, m, n, "svd")
    if min(m, n) <= _DENSE:
        rank, method = rank_of(scipy.linalg.svdvals(weighted.toarray()), residual), "svd"
    else:
        rank, method = _counted(weighted, residual), "pivots"
    return Constraints(m, rank, m - rank, n - rank, method)


def _counted(weighted: Any, residual: float) -> int:
    """Count the eigenvalues of C C^T (or C^T C) above the squared tolerance, without computing any but the largest."""
    wide = weighted if weighted.shape[0] <= weighted.shape[1] else weighted.T
    first = np.random.default_rng(0).normal(size=wide.shape[0])  # the same result each time
    largest = float(scipy.sparse.linalg.svds(wide, k=1, v0=first, return_singular_vectors=False)[0])
    shift = (rank_tolerance(residual) * largest) ** 2
    shifted = (wide @ wide.T - shift * scipy.sparse.identity(wide.shape[0])).tocsc()
    how = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0}
    factors = scipy.sparse.linalg.splu(shifted, **how, options={"SymmetricMode": True})
    if not np.array_equal(factors.perm_r, factors.perm_c):
        msg = (
            f"the rank of {weighted.shape[0]} bonds is not determined by pivots, expected all of them on the diagonal;"
            " move a particle by a rounding error"
        )
        raise ValueError(msg)
    return int((factors.U.diagonal() > 0).sum())


def bands(matrix: DynamicalMatrix, found: Spectrum) -> list[Band]:
    """Split a whole spectrum into its bands, from the lowest, without translations.

    The high band begins at the widest gap near the rank of H. Below it, modes of first and
    of second order in the prestress are distinguished by magnitude: with the mean overlap x and stiffness k of
    bonds, first order is about k x and second k x^2, and the cut is at k x^(3/2). Far above jamming there
    are no such gaps, and more bonds than modes: see `why_no_bands`.

    Parameters
    ----------
    matrix : DynamicalMatrix
    found : Spectrum

    Returns
    -------
    list of Band
        The nonempty bands that are separated from the others.
    """
    return _split(matrix, found).bands


def why_no_bands(matrix: DynamicalMatrix, found: Spectrum) -> str:
    """Return why modes of a whole spectrum are in no band; an empty text if all but translations are in one."""
    return _split(matrix, found).reason


class _Split(NamedTuple):
    bands: list[Band]
    reason: str
    """Reason why other modes are in no band."""


def _split(matrix: DynamicalMatrix, found: Spectrum) -> _Split:
    real = np.flatnonzero(~found.is_translation)
    order = real[np.argsort(np.abs(found.eigenvalues[real]), kind="stable")]
    size = np.abs(found.eigenvalues[order])
    n, rank = len(size), found.rank(matrix.residual.largest)
    if n and not len(found.singular_values):
        return _Split([], f"no bands: the method {found.method} does not find the rank of H")
    reach = max(_NEAR_RANK_MODES, int(_NEAR_RANK * n))
    n_low = int((size < _cut(matrix)).sum())
    n_below = _gap_near(size, n_low, n - rank, reach)
    if rank >= n and matrix.n_bonds - n > max(_NEAR_RANK_MODES, _EXCESS * n):
        held = f"{matrix.n_bonds} bonds constrain all of the {n} vibrational modes"
        return _Split([], f"no bands: {held}, as far above jamming")
    gap = _ratio(size, n_below)
    if gap < _GAP or abs(n_below - (n - rank)) > reach:
        below = f"the rank of H, {rank}, leaves {n - rank} modes below the high band"
        widest = f"the widest gap near there, above {n_below} modes, is a factor of {gap:.2g}"
        return _Split([], f"no bands: {below}, but {widest} between eigenvalues, expected {_GAP:g}")
    high = [_band(found, "high", order[n_below:], gap)] if n_below < n else []
    if _ratio(size, n_low) < _GAP and n_low < n_below:
        where = f"the softest {n_below} modes do not split into low and middle bands"
        reason = f"{where}: no gap of a factor of {_GAP:g} between first and second order in the prestress"
        return _Split(high, reason)
    limits = {"low": (0, n_low), "middle": (n_low, n_below)}
    soft = [
        _band(found, name, order[first:last], _ratio(size, first))
        for name, (first, last) in limits.items()
        if last > first
    ]
    return _Split(soft + high, "")


def _cut(matrix: DynamicalMatrix) -> float:
    """Eigenvalue between those of first and of second order in the prestress."""
    stiffness = float(matrix.bonds.stiffness.mean())
    distance = float(matrix.contacts["distance"][matrix.contacts["distance"] > 0].mean())
    return float(stiffness * (matrix.bond_force / (stiffness * distance)) ** 1.5)


def _ratio(size: FloatArray, first: int) -> float:
    """Ratio of a value to the one below; inf if it is the lowest, or there is none."""
    return float(size[first] / size[first - 1]) if 0 < first < len(size) else np.inf


def _gap_near(size: FloatArray, least: int, expected: int, reach: int) -> int:
    """Count the modes below the widest gap that lies near an expected number."""
    if expected <= least:
        return least
    candidates = np.arange(max(least + 1, expected - reach), min(len(size) - 1, expected + reach))
    width = size[candidates] / size[candidates - 1]
    return int(candidates[np.argmax(width)]) if len(candidates) else expected


def _band(found: Spectrum, name: str, modes: IntArray, gap: float) -> Band:
    values, sign = found.eigenvalues[modes], found.sign[modes]
    omega = np.sqrt(values[sign > 0])
    return Band(
        name=name,
        modes=np.sort(modes),
        n_negative=int((sign < 0).sum()),
        n_unsure=int((sign == 0).sum()),
        mean_omega=float(omega.mean()) if len(omega) else np.nan,
        gap_below=float(gap),
    )


def redundancies(matrix: DynamicalMatrix) -> list[Redundancy]:
    """Find bonds that can carry stress beside that of the whole packing, such as rings of flat rods.

    These are states of self stress, null vectors of C^T, orthogonal to the forces that balance in the
    packing. Needs the singular vectors of C: as costly as a whole spectrum.
    """
    left, sigma, _ = scipy.linalg.svd(matrix.compatibility.toarray())
    null, own = left[:, rank_of(sigma, matrix.residual.largest) :], _self_stress(matrix)
    further, share = np.linalg.svd(null - np.outer(own, own @ null), full_matrices=False)[:2]
    return _grouped(matrix, further[:, share > 0.5])


def _self_stress(matrix: DynamicalMatrix) -> FloatArray:
    """(m,) unit vector of the bond forces over the square roots of their stiffness."""
    own = matrix.bonds.pull
    return np.asarray(own / max(float(np.linalg.norm(own)), 1e-300))


def _grouped(matrix: DynamicalMatrix, states: FloatArray) -> list[Redundancy]:
    """Group the bonds of states of self stress (m, q), orthonormal, by shared particles."""
    involved = np.flatnonzero((states**2).sum(axis=1) > _SHARE)
    if not len(involved):
        return []
    particles = matrix.bonds.particles[involved]
    graph = np.zeros((len(involved), matrix.coordinates.n_all), bool)
    graph[np.arange(len(involved))[:, None], particles] = True
    shared = graph.astype(np.int64) @ graph.T > 0
    n_groups, group = scipy.sparse.csgraph.connected_components(shared, directed=False)
    return [_redundancy(matrix, states, involved[group == g]) for g in range(n_groups)]


def _redundancy(matrix: DynamicalMatrix, states: FloatArray, bonds: IntArray) -> Redundancy:
    """Describe states of self stress (m, q) that involve some of the bonds."""
    _, share, mix = np.linalg.svd(states[bonds], full_matrices=False)
    own = states @ mix[share > 0.5].T
    pushes = matrix.compatibility.T @ own
    return Redundancy(
        n_states=own.shape[1],
        bonds=bonds,
        particles=np.unique(matrix.bonds.particles[bonds]),
        largest_singular_value=float(np.linalg.norm(pushes, 2)) if own.shape[1] else 0.0,
    )
