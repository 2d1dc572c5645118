"""The dynamical matrix of a packing without its rattlers: M = H - S.

Marschall & Teitel 2018, Eqs. 23 and 38-40. The stiffness is stored as its factor C, one row a bond, with
H = C^T C, separate from the prestress S, which is smaller by the overlap: their sum in doubles has lost all
modes softer than 1e-16. Independent of the shape: only a landscape's second derivatives of each contact enter.
Needs no LAMMPS.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import NDArray

from jamshape.arrays import FloatArray, IntArray, LongArray
from jamshape.landscape import Evaluation, Landscape, State, contracted
from jamshape.minima import Residual, residual_of
from jamshape.records import Record
from jamshape.vibration.extended import EPS

ROUNDINGS = 4.0
"""Error of entries of C and S, and of pressures, in roundings, at most: of their factors, and of sums."""

# Bound of the error of lengths in roundings of long doubles: sums of squares, roots, and positions of feet.
_ROUNDINGS = 4.0

# A state with a larger residual is not a minimum, and has no modes.
LARGEST_RESIDUAL = 1e-4


class NotAtMinimumError(ValueError):
    """A state is not a minimum of the energy; the message gives its residual."""


@dataclass(frozen=True, eq=False)
class Coordinates(Record):
    """Meaning of the components of a mode.

    Parameters
    ----------
    particle : (n,) array of int64
        Row of the packing, for each coordinate, ascending.
    kind : (n,) array of int64
        0 to D - 1: displacement along that axis. D and up: a rotation.
    direction : (n, D + T) array of float64
        Displacement and rotation [radian] of that particle per unit of length; T = 1 in 2D, 3 in
        3D, in space coordinates.
    n_all : int
        Number of particles N of the packing, rattlers included.
    dimension : int
    """

    particle: IntArray
    kind: IntArray
    direction: FloatArray
    n_all: int
    dimension: int

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return len(self.particle)

    @cached_property
    def backbone(self) -> IntArray:
        """(N',) rows of the packing that have coordinates."""
        return np.unique(self.particle)

    @property
    def is_rotation(self) -> NDArray[np.bool_]:
        """(n,) whether each coordinate is a rotation."""
        return self.kind >= self.dimension

    @cached_property
    def embedding(self) -> Any:
        """(N (D + T), n) scipy.sparse matrix of the displacements and rotations of all particles."""
        width = self.direction.shape[1]
        row = self.particle[:, None] * width + np.arange(width)
        column = np.broadcast_to(np.arange(self.size)[:, None], row.shape)
        used = self.direction != 0
        entries = (self.direction[used], (row[used], column[used]))
        return scipy.sparse.csr_matrix(entries, shape=(self.n_all * width, self.size))

    def motion(self, vector: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Expand an (n,) vector: (N, D) displacements and (N, T) rotations [radian], 0 elsewhere."""
        components = (self.embedding @ vector).reshape(self.n_all, -1)
        return components[:, : self.dimension], components[:, self.dimension :]


class Bonds(NamedTuple):
    """The m rows of the compatibility matrix.

    For two bonds with coupled energies (`Landscape.derivatives`) the first row is along a sum of both
    lengths, such that there is one row per bond and H is the sum of their squares.
    """

    contact: IntArray
    """(m,) row of `DynamicalMatrix.contacts`."""
    slot: IntArray
    """(m,) index of the bond in its contact."""
    particles: IntArray
    """(m, 2) rows of the packing."""
    stiffness: FloatArray
    """(m,) second derivative of the energy along the bond, [energy / length^2]."""
    gradient: FloatArray
    """(m, v) derivative of its length by the pair's variables r_i - r_j, rotations of i and of j [radian]."""
    pull: FloatArray
    """(m,) force over the square root of the stiffness; C^T pull are the bond forces."""


class Strains(NamedTuple):
    """Response of a packing to k affine strains, with all second derivatives of the energy."""

    stretched: FloatArray
    """(m, k) change of the bond lengths, times the square roots of their stiffness."""
    pushed: FloatArray
    """(n, k) change of the forces by the prestress alone, -S between strain and coordinates."""
    affine: LongArray
    """(k, k) second derivatives of the energy by the prestress alone, in long double."""


@dataclass(frozen=True, eq=False)
class DynamicalMatrix(Record):
    """M = C^T C - S of n coordinates and m bonds (Marschall & Teitel 2018, Eqs. 38-40).

    Every entry is a double with an error of a few roundings of its summands.

    Parameters
    ----------
    compatibility : (m, n) scipy.sparse CSR matrix, [sqrt(energy) / length]
        C: one row a bond, the square root of its stiffness times the gradient of its length.
    prestress : (n, n) scipy.sparse CSR matrix, [energy / length^2]
        S, symmetric to the last bit.
    prestress_sizes : (n, n) scipy.sparse CSR matrix
        Sums of the magnitudes of the summands of each entry of S.
    coordinates : Coordinates
    bonds : Bonds
    curvature : (C, v, v) array of float64
        Second derivatives of the contacts' energies, without the bonds' stiffness: S of each contact.
    contacts : dict
        `Landscape.derivatives` of the contacts between particles other than rattlers.
    gradient : (n,) array of float64, [energy / length]
        Gradient of the energy; 0 at a minimum.
    residual : Residual
        Largest net force and torque over the mean bond force, without rattlers.
    bond_force : float, [energy / length]
        Mean magnitude of the force of a bond.
    volume : float, [length^D]
    n_left_out : int
        Number of contacts between these particles left out by the force threshold.
    """

    compatibility: Any
    prestress: Any
    prestress_sizes: Any
    coordinates: Coordinates
    bonds: Bonds
    curvature: FloatArray
    contacts: dict[str, NDArray[Any]]
    gradient: FloatArray
    residual: Residual
    bond_force: float
    volume: float
    n_left_out: int = 0

    @property
    def size(self) -> int:
        """Number of coordinates n."""
        return self.coordinates.size

    @property
    def n_bonds(self) -> int:
        """Number of bonds N_c; a side-to-side contact has two."""
        return len(self.bonds.contact)

    @property
    def n_particles(self) -> int:
        """Number of particles N', without rattlers."""
        return len(self.coordinates.backbone)

    @property
    def z(self) -> float:
        """Bonds per particle, each counted at both ends."""
        return 2 * self.n_bonds / self.n_particles

    @property
    def stiffness(self) -> Any:
        """(n, n) scipy.sparse CSR matrix H = C^T C."""
        return (self.compatibility.T @ self.compatibility).tocsr()

    @property
    def matrix(self) -> Any:
        """(n, n) scipy.sparse CSR matrix M = H - S, in double precision."""
        return (self.stiffness - self.prestress).tocsr()

    @cached_property
    def overlap_rounding(self) -> FloatArray:
        """(C,) bound of the relative rounding error of the contacts' forces; overlaps are small differences of lengths.

        A force is stiffness times overlap; lengths are of the order of the separation, in long double.
        """
        distance = np.linalg.norm(self.contacts["separation"], axis=1)
        lost = _ROUNDINGS * EPS * self.contacts["stiffness"].sum(axis=1) * distance
        return np.asarray(lost / self.contacts["bond_force"].sum(axis=1))

    @cached_property
    def prestress_rounding(self) -> Any:
        """(n, n) scipy.sparse CSR matrix, bound of the error of S by rounding of overlaps."""
        scatter = _Scatter(self.contacts["particles"], self.coordinates)
        return scatter.sizes(self.overlap_rounding[:, None, None] * self.curvature)

    @cached_property
    def translations(self) -> FloatArray:
        """(n, D c) orthonormal columns, the null modes of M, D for each of c clusters of particles."""
        backbone, D = self.coordinates.backbone, self.coordinates.dimension
        first, second = np.searchsorted(backbone, self.bonds.particles.T)
        n = len(backbone)
        graph = scipy.sparse.coo_matrix((np.ones(len(first)), (first, second)), shape=(n, n))
        n_clusters, cluster = scipy.sparse.csgraph.connected_components(graph, directed=False)
        own = cluster[np.searchsorted(backbone, self.coordinates.particle)]
        moves = ~self.coordinates.is_rotation
        columns = np.zeros((self.size, D * n_clusters))
        columns[np.flatnonzero(moves), (D * own + self.coordinates.kind)[moves]] = 1.0
        unit: FloatArray = columns / np.sqrt(columns.sum(axis=0))
        return unit

    def strained(self, strains: FloatArray) -> Strains:
        """Return the response to (k, D, D) strains e, r_i - r_j -> (1 + e) (r_i - r_j), at fixed orientations."""
        D = self.coordinates.dimension
        moved = np.einsum("kab,cb->cka", strains, self.contacts["separation"])
        rows = np.sqrt(self.bonds.stiffness)[:, None] * self.bonds.gradient[:, :D]
        stretched = np.einsum("ma,mka->mk", rows, moved[self.bonds.contact])
        bent = np.einsum("cva,cka->ckv", self.curvature[:, :, :D], moved)
        scatter = _Scatter(self.contacts["particles"], self.coordinates)
        pushed = np.column_stack([scatter.vector(bent[:, k]) for k in range(len(strains))])
        affine = np.einsum("cka,cla->kl", bent[:, :, :D], moved, dtype=np.longdouble)
        return Strains(stretched, pushed, affine)

    @property
    def pressure_tensor(self) -> FloatArray:
        """(D, D) pressure tensor of these contacts, symmetric."""
        return self._virial(self.contacts["separation"], self.contacts["force"])

    @property
    def pressure_rounding(self) -> FloatArray:
        """(D, D) bound of its error by rounding."""
        separation, force = (np.abs(self.contacts[name]) for name in ("separation", "force"))
        lost = ROUNDINGS * np.finfo(np.float64).eps + self.overlap_rounding
        return self._virial(separation, force * lost[:, None])

    def _virial(self, separation: FloatArray, force: FloatArray) -> FloatArray:
        virial = np.einsum("ca,cb->ab", separation, force) / self.volume
        return np.asarray(0.5 * (virial + virial.T))

    def strained_sizes(self, strains: FloatArray) -> tuple[Strains, Strains]:
        """Sum the magnitudes of the summands in `strained`, and bound the effect of rounding of overlaps."""
        D = self.coordinates.dimension
        moved = np.einsum("kab,cb->cka", np.abs(strains), np.abs(self.contacts["separation"]))
        rows = np.abs(np.sqrt(self.bonds.stiffness)[:, None] * self.bonds.gradient[:, :D])
        stretched = np.einsum("ma,mka->mk", rows, moved[self.bonds.contact])
        scatter = _Scatter(self.contacts["particles"], self.coordinates)

        def added(curvature: FloatArray, stretched: FloatArray) -> Strains:
            bent = np.einsum("cva,cka->ckv", np.abs(curvature[:, :, :D]), moved)
            pushed = [scatter.vector_sizes(bent[:, k]) for k in range(len(strains))]
            affine = np.einsum("cka,cla->kl", bent[:, :, :D], moved)
            return Strains(stretched, np.column_stack(pushed), affine)

        lost = self.overlap_rounding[:, None, None] * self.curvature
        return added(self.curvature, stretched), added(lost, 0 * stretched)


@dataclass(frozen=True, eq=False)
class DynamicalMatrixOptions:
    """Options of `dynamical_matrix`: contacts to include and scale of rotations.

    Parameters
    ----------
    rotation : str or (N,) array of float64, [length]
        Length that scales radians: ``half_length`` (A theta, Marschall & Teitel 2018, Eq. 23, or a theta),
        ``radius`` (R theta, or the shortest semi-axis) or lengths. Discs, on which no contact exerts a torque, never have
        rotations. Eigenvalues of modes with rotation depend on this choice; their number, signs and zeros do not.
    least_force : float
        Omit contacts whose force is below this fraction of the mean bond force: rods that slid
        along flat sides up to others touch them with forces of second order in the overlap, which
        minimisers in doubles do not resolve.
    backbone : (N,) array of bool, optional
        Particles to include, with the contacts between them; by default all but rattlers.
    force : bool
        Proceed even if the state is not a minimum.
    """

    rotation: str | FloatArray = "half_length"
    least_force: float = 0.0
    backbone: NDArray[np.bool_] | None = None
    force: bool = False


def dynamical_matrix(
    landscape: Landscape, state: State, options: DynamicalMatrixOptions | None = None
) -> DynamicalMatrix:
    """Assemble the dynamical matrix of a minimum of the energy.

    Parameters
    ----------
    landscape : Landscape
    state : State
    options : DynamicalMatrixOptions, optional

    Returns
    -------
    DynamicalMatrix

    Raises
    ------
    NotAtMinimumError
        If the residual is above `LARGEST_RESIDUAL`, unless forced.
    ValueError
        If all particles are rattlers, or the scope's rotation is invalid.
    CrossingError
        If two spines cross.
    """
    options = options or DynamicalMatrixOptions()
    evaluation = landscape.evaluate(state)
    taken = ~landscape.rattlers(state) if options.backbone is None else np.asarray(options.backbone)
    if not taken.any():
        msg = (
            f"all {len(taken)} particles are rattlers, so there are no modes,"
            " expected a jammed packing"
        )
        raise ValueError(msg)
    held = np.where(taken[landscape.particle_of_coordinate()], evaluation.gradient, 0.0)
    residual = residual_of(landscape, evaluation._replace(gradient=held))
    if residual.largest > LARGEST_RESIDUAL and not options.force:
        msg = (
            f"the state is not at a minimum: its largest net force is {residual.largest:.2g} of the"
            f" mean bond force, expected at most {LARGEST_RESIDUAL:g}; minimise it first (a state at rest on a"
            " kink of the energy has no modes), or use force (--force)"
        )
        raise NotAtMinimumError(msg)
    coordinates = _coordinates(landscape, state, taken, _lengths(landscape, options.rotation))
    weakest = options.least_force * evaluation.bond_force
    parts = _parts(landscape, state, coordinates, weakest)
    return _matrix(landscape, state, evaluation, parts | {"residual": residual})


def matrix_at(landscape: Landscape, state: State, coordinates: Coordinates) -> DynamicalMatrix:
    """Assemble the matrix of any state in given coordinates, without checks."""
    evaluation = landscape.evaluate(state)
    parts = _parts(landscape, state, coordinates)
    return _matrix(
        landscape, state, evaluation, parts | {"residual": residual_of(landscape, evaluation)}
    )


def all_coordinates(landscape: Landscape, rotation: str | FloatArray = "radian") -> Coordinates:
    """List displacements and rotations of all particles along the axes of space, particle by particle.

    Parameters
    ----------
    landscape : Landscape
    rotation : str or (N,) array of float64, [length]
        As for `DynamicalMatrixOptions`, or ``radian``.

    Returns
    -------
    Coordinates
        Those of the landscape: rattlers have some, rotations of discs and spheres none, and rods in space also
        spin about their axes.

    Raises
    ------
    ValueError
        If the rotation is invalid.
    """
    lengths, D = _lengths(landscape, rotation), landscape.particles.dimension
    particle, kind = np.nonzero(landscape.column >= 0)
    direction = np.eye(landscape.column.shape[1])[kind]
    turns = kind >= D
    direction[turns] /= lengths[particle[turns], None]
    return Coordinates(particle, kind, direction, len(lengths), D)


def hessian_product(
    landscape: Landscape, state: State, coordinates: Coordinates
) -> scipy.sparse.linalg.LinearOperator:
    """Return the product of the Hessian with vectors, summed over contacts without assembling a matrix.

    Errors are those of `Landscape.evaluate`.
    """
    contacts = landscape.derivatives(state, extended=True)
    blocks, scatter = contracted(contacts), _Scatter(contacts["particles"], coordinates)

    def product(vector: FloatArray) -> FloatArray:
        moved = scatter.moved(np.ravel(vector))
        return scatter.vector(np.einsum("cij,cj->ci", blocks, moved))

    n = coordinates.size
    return scipy.sparse.linalg.LinearOperator(
        (n, n), matvec=product, rmatvec=product, dtype=np.float64
    )


class BondLengths(NamedTuple):
    """Lengths of m compressed bonds."""

    contact: IntArray
    """(m,) row of the contacts."""
    overlap: FloatArray
    """(m,) force over stiffness, [length]."""
    by_variables: FloatArray
    """(m, v) derivative of the length by the pair's variables."""
    gradient: Any
    """(m, n) scipy.sparse CSR matrix, derivative by coordinates."""


def lengths_of_bonds(contacts: dict[str, NDArray[Any]], coordinates: Coordinates) -> BondLengths:
    """List the bonds of contacts (`Landscape.derivatives`) with their lengths as functions of coordinates."""
    contact, slot = np.nonzero(contacts["stiffness"] > 0)
    gradient = contacts["gradient"][contact, slot]
    overlap = contacts["bond_force"][contact, slot] / contacts["stiffness"][contact, slot]
    rows = _Scatter(contacts["particles"], coordinates).rows(gradient, contact)
    return BondLengths(contact, overlap, gradient, rows)


def _matrix(
    landscape: Landscape, state: State, evaluation: Evaluation, parts: dict[str, Any]
) -> DynamicalMatrix:
    gradient = gradient_in(parts["coordinates"], landscape, evaluation)
    return DynamicalMatrix(
        **parts, gradient=gradient, bond_force=evaluation.bond_force, volume=state.volume
    )


def _lengths(landscape: Landscape, rotation: str | FloatArray) -> FloatArray:
    """(N,) lengths that scale radians; 0 where nothing rotates."""
    own = landscape.rotation_length
    if isinstance(rotation, str):
        known = {"half_length": own, "radius": landscape.inner_radius, "radian": np.ones_like(own)}
        if rotation not in known:
            msg = f"rotation is {rotation!r}, expected one of {', '.join(known)}, or lengths"
            raise ValueError(msg)
        chosen = known[rotation]
    else:
        chosen = np.broadcast_to(np.asarray(rotation, np.float64), own.shape)
    lengths: FloatArray = np.where(own > 0, chosen, 0.0)
    if not (np.isfinite(lengths) & (lengths > 0))[own > 0].all():
        msg = "rotation lengths are not all positive, expected lengths > 0 for particles that can rotate"
        raise ValueError(msg)
    return lengths


def _coordinates(
    landscape: Landscape, state: State, held: NDArray[np.bool_], lengths: FloatArray
) -> Coordinates:
    """List displacements and rotations of the particles that are held, particle by particle."""
    D = state.dimension
    axes = state.packing(landscape.particles).turning_axes
    n, n_turns, T = axes.shape
    direction = np.zeros((n, D + n_turns, D + T))
    direction[:, :D, :D] = np.eye(D)
    turns = lengths > 0
    direction[turns, D:, D:] = axes[turns] / lengths[turns, None, None]
    used = held[:, None] & (direction != 0).any(axis=2)
    particle, kind = np.nonzero(used)
    return Coordinates(particle, kind, direction[used], n, D)


def gradient_in(
    coordinates: Coordinates, landscape: Landscape, evaluation: Evaluation
) -> FloatArray:
    """Transform the gradient of a landscape, (n,), to coordinates of modes, [energy / length]."""
    D = coordinates.dimension
    components = landscape.components(evaluation.gradient)
    components[:, D:] *= landscape.rotation_length[:, None]  # per radian
    return np.asarray(coordinates.embedding.T @ components.ravel())


def _parts(
    landscape: Landscape, state: State, coordinates: Coordinates, weakest: float = 0.0
) -> dict[str, Any]:
    """Build the fields of a DynamicalMatrix that follow from contacts and coordinates."""
    every = landscape.derivatives(state, extended=True)
    is_held = np.zeros(coordinates.n_all, bool)
    is_held[coordinates.backbone] = True
    held = is_held[every["particles"]].all(axis=1)
    strong = every["bond_force"].sum(axis=1) >= weakest
    contacts = {name: values[held & strong] for name, values in every.items()}
    bonds = _bonds(contacts)
    scatter = _Scatter(contacts["particles"], coordinates)
    prestress = scatter.blocks(-contacts["curvature"])
    return {
        "compatibility": scatter.rows(
            np.sqrt(bonds.stiffness)[:, None] * bonds.gradient, bonds.contact
        ),
        "prestress": prestress,
        "prestress_sizes": scatter.sizes(contacts["curvature"]),
        "coordinates": coordinates,
        "bonds": bonds,
        "curvature": contacts["curvature"],
        "contacts": contacts,
        "n_left_out": int((held & ~strong).sum()),
    }


def _bonds(contacts: dict[str, NDArray[Any]]) -> Bonds:
    """List the bonds.

    The stiffness of a contact's bonds, diag(s) + c c^T in their lengths, c their coupling, is L diag(d) L^T
    with a lower triangle L: rows of d and L^T gradient. Computed column by column, without subtractions.
    """
    stiffness, gradient, force = (
        contacts[name].copy() for name in ("stiffness", "gradient", "bond_force")
    )
    coupling, left = contacts["coupling"], np.ones(len(stiffness))
    for k in range(stiffness.shape[1]):
        own = stiffness[:, k].copy()
        stiffness[:, k] += left * coupling[:, k] ** 2
        of = left * coupling[:, k] / np.where(stiffness[:, k] > 0, stiffness[:, k], 1.0)
        for later in range(k + 1, stiffness.shape[1]):
            entry = of * coupling[:, later]
            gradient[:, k] += entry[:, None] * gradient[:, later]
            force[:, later] -= entry * force[:, k]
        left = left * own / np.where(stiffness[:, k] > 0, stiffness[:, k], 1.0)
    contact, slot = np.nonzero(stiffness > 0)
    stiffness = stiffness[contact, slot]
    pull = force[contact, slot] / np.sqrt(stiffness)
    particles = contacts["particles"][contact]
    return Bonds(contact, slot, particles, stiffness, gradient[contact, slot], pull)


class _Scatter:
    """Assembles rows and blocks in a pair's variables into matrices over coordinates."""

    def __init__(self, particles: IntArray, coordinates: Coordinates) -> None:
        D, T = coordinates.dimension, coordinates.direction.shape[1] - coordinates.dimension
        separation, turn = np.arange(D), np.arange(D, D + T)
        self._dimension = D
        self._variable = np.concatenate([separation, turn, separation, turn + T])
        self._sign = np.concatenate([np.ones(D + T), -np.ones(D), np.ones(T)])
        width = D + T
        ends = particles[:, :, None] * width + np.arange(width)
        self._place = ends.reshape(len(particles), 2 * width)
        self._embedding = coordinates.embedding

    def rows(self, rows: FloatArray, contact: IntArray) -> Any:
        """(m, n) CSR matrix of (m, v) rows of some contacts."""
        place = self._place[contact]
        entries = rows[:, self._variable] * self._sign
        row = np.broadcast_to(np.arange(len(rows))[:, None], place.shape)
        shape = (len(rows), self._embedding.shape[0])
        flat = (entries.ravel(), (row.ravel(), place.ravel()))
        return _tidy(scipy.sparse.csr_matrix(flat, shape=shape) @ self._embedding)

    def moved(self, vector: FloatArray) -> FloatArray:
        """(C, v) change of the pairs' variables by (n,) coordinates: the transpose of `vector`."""
        ends = (self._embedding @ vector)[self._place] * self._sign
        (first, second), D = np.split(ends, 2, axis=1), self._dimension
        parts = [first[:, :D] + second[:, :D], first[:, D:], second[:, D:]]
        return np.concatenate(parts, axis=1)

    def vector(self, vectors: FloatArray) -> FloatArray:
        """(n,) sum of (C, v) vectors."""
        full = np.zeros(self._embedding.shape[0])
        np.add.at(full, self._place, vectors[:, self._variable] * self._sign)
        return np.asarray(self._embedding.T @ full)

    def vector_sizes(self, vectors: FloatArray) -> FloatArray:
        """(n,) sum of the magnitudes of the summands of such vectors."""
        full = np.zeros(self._embedding.shape[0])
        np.add.at(full, self._place, np.abs(vectors[:, self._variable]))
        return np.asarray(abs(self._embedding).T @ full)

    def blocks(self, blocks: FloatArray) -> Any:
        """(n, n) CSR matrix of (C, v, v) blocks, symmetric to the last bit."""
        sign = self._sign[:, None] * self._sign
        matrix = self._assembled(blocks, sign, self._embedding)
        return _tidy(0.5 * (matrix + matrix.T))

    def sizes(self, blocks: FloatArray) -> Any:
        """(n, n) CSR matrix of the magnitudes of the summands of such blocks."""
        return self._assembled(np.abs(blocks), 1.0, abs(self._embedding))

    def _assembled(self, blocks: FloatArray, sign: FloatArray | float, embedding: Any) -> Any:
        entries = blocks[:, self._variable[:, None], self._variable] * sign
        row = np.broadcast_to(self._place[:, :, None], entries.shape).ravel()
        column = np.broadcast_to(self._place[:, None, :], entries.shape).ravel()
        shape = (self._embedding.shape[0],) * 2
        full = scipy.sparse.csr_matrix((entries.ravel(), (row, column)), shape=shape)
        return _tidy(embedding.T @ full @ embedding)


def _tidy(matrix: Any) -> Any:
    """Return CSR with ascending columns and without stored zeros."""
    matrix = scipy.sparse.csr_matrix(matrix)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix
