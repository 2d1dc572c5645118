"""The energy landscape of a packing: energy, forces and Hessian as functions of its coordinates.

Coordinates are displacements and rotations of a `State`, in one vector. Angles are scaled to lengths: A theta
(Marschall & Teitel 2018, Eq. 23), or a times the three angles (Yuan et al. 2019), so that all
components are comparable; rotations without torque, as of discs and spheres, are left out. Needs no LAMMPS.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import scipy  # loads its parts once they are used
from numpy.typing import ArrayLike, NDArray

from jamshape.arrays import BoolArray, FloatArray, IntArray
from jamshape.contacts import PairArrays, Pairs, find_contacts, find_rattlers
from jamshape.contacts.near import near_particles
from jamshape.contacts.network import refuse_crossing, refuse_unconverged
from jamshape.packing import Packing, State
from jamshape.shapes.shape import Stiffness

_SKIN = 0.3  # of the pair list, over the smallest radius


class Evaluation(NamedTuple):
    """Energy and its derivatives at one state."""

    energy: float
    gradient: FloatArray
    """(n,) in the coordinates of the landscape, [energy / length]."""
    strain_gradient: float
    """dU/d(strain) of the affine strain of `State.strained`, equal to -D V p."""
    bond_force: float
    """Mean magnitude of the force of a bond; 0 without bonds."""
    n_bonds: int
    virial: FloatArray
    """(D, D) sum of r_k f_l over contacts, [energy]; its trace is minus the strain gradient."""


class Curvature(NamedTuple):
    """Second derivatives of the energy at one state."""

    hessian: Any
    """(n, n) scipy.sparse CSC matrix in the coordinates of the landscape; the whole diagonal is stored."""
    coupling: FloatArray
    """(n,) d(gradient)/d(strain)."""
    strain_hessian: float
    """Second derivative of the energy with respect to the strain."""


class Landscape:
    """Elastic energy of the particles of a packing, including periodic images.

    Parameters
    ----------
    packing : Packing
        Provides shapes and law.
    k_e : float or (T, T) array_like, [energy], optional
    sides : {1, 2}, optional
        Bonds of a side-to-side contact, of shapes that have both laws; minima exist for 2 only. Both are
        those of the packing's law by default.

    Notes
    -----
    Keeps a list of pairs that may touch and rebuilds it when particles have moved too far.
    """

    def __init__(
        self, packing: Packing, k_e: ArrayLike | None = None, sides: int | None = None
    ) -> None:
        law = packing.law.but(k_e, sides)
        self.particles, self.k_e, self.sides = packing, law.k_e, law.sides
        self.law = law
        self.bodies = packing.compiled(law)
        self.evaluations = 0
        self._pairs: Pairs | None = None

    def __reduce__(self) -> tuple[type[Landscape], tuple[Packing, Stiffness, int]]:
        return type(self), (self.particles, self.k_e, self.sides)

    @cached_property
    def stiffness(self) -> float:
        """The unit of energy, k_e, or the largest one of a table."""
        return float(np.max(self.k_e))

    def stiffness_at(self, bond_force: float) -> float:
        """Return the stiffness of a bond with a force, times the square of `length`: k_e if it is harmonic."""
        slope, power = bond_force * self.length / self.stiffness, self.law.power
        overlap = slope * self.law.overlap_over_harmonic(slope)
        softer: float = (power - 1) * overlap ** (power - 2)
        return softer * self.stiffness

    @cached_property
    def rotation_length(self) -> FloatArray:
        """(N,) lengths that scale radians (A, or a); 0 where nothing can rotate."""
        return np.asarray(self.bodies.rotation_length)

    @cached_property
    def inner_radius(self) -> FloatArray:
        """(N,) smallest lengths of the particles, R or the shortest semi-axis."""
        return np.asarray(self.bodies.inner_radius)

    @cached_property
    def turning_radius(self) -> FloatArray:
        """(N,) largest displacement of a particle's surface by a rotation of one radian."""
        return np.asarray(self.bodies.turning_radius)

    @cached_property
    def length(self) -> float:
        """The unit of length, twice the smallest of `inner_radius`."""
        return 2 * float(self.inner_radius.min())

    @cached_property
    def _free(self) -> NDArray[np.bool_]:
        """(N, D + rotations) whether each component is a coordinate."""
        D = self.particles.dimension
        turns = self.rotation_length > 0
        n_turns = 1 if D == 2 else 3
        return np.column_stack([np.ones((len(turns), D), bool), *[turns] * n_turns])

    @cached_property
    def size(self) -> int:
        """Number of coordinates n."""
        return int(self._free.sum())

    def displaced(self, state: State, step: FloatArray) -> State:
        """Move along (n,) coordinates, [length]."""
        return state.displaced(*self.motion(step))

    def motion(self, step: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Split (n,) coordinates into (N, D) displacements and (N, 1 or 3) rotations [radian]."""
        components, D = self.components(step), self.particles.dimension
        return components[:, :D], components[:, D:] / self._length_or_1[:, None]

    def forget_pairs(self) -> None:
        """Rebuild the pair list, so that results depend on the state alone, to the last bit."""
        self._pairs = None

    def components(self, vector: FloatArray) -> FloatArray:
        """Scatter an (n,) vector to (N, D + rotations), with 0 where there is no coordinate."""
        full = np.zeros(self._free.shape)
        full[self._free] = vector
        return full

    def coordinates(self, components: FloatArray) -> FloatArray:
        """Gather an (n,) vector from (N, D + rotations), the inverse of `components`."""
        return components[self._free]

    def particle_of_coordinate(self) -> IntArray:
        """(n,) index of the particle of each coordinate."""
        return np.nonzero(self._free)[0]

    def evaluate(self, state: State, *, extended: bool = True) -> Evaluation:
        """Evaluate energy and gradient.

        Parameters
        ----------
        state : State
        extended : bool
            Sum in long double: three times slower, with two thousand times less rounding.

        Raises
        ------
        CrossingError
            If two spines cross.
        ValueError
            If a contact did not converge.
        """
        self.evaluations += 1
        found = self._sums(state, extended)
        slope = -np.column_stack([found["force"], found["torque"] / self._length_or_1[:, None]])
        n_bonds = found["n_bonds"]
        return Evaluation(
            energy=found["energy"],
            gradient=slope[self._free],
            strain_gradient=-float(np.trace(found["virial"])),
            bond_force=found["bond_force"] / max(n_bonds, 1),
            n_bonds=n_bonds,
            virial=np.asarray(found["virial"], np.float64),
        )

    def stress(self, state: State) -> FloatArray:
        """(D, D) pressure tensor, p_kl the sum of r_l f_k over contacts, over the volume; errors as `evaluate`.

        -p_xy is the derivative of the energy under simple shear, x displaced by gamma y, at fixed orientations.
        """
        found = self._sums(state, True)
        return np.asarray(found["virial"].T / state.volume, np.float64)

    def refuse(self, crossing: IntArray, unconverged: IntArray) -> None:
        """Raise like `evaluate` for pairs (k, 2) of crossing or unconverged particles, if there are any."""
        refuse_crossing(self.particles, self.bodies.core, crossing)
        refuse_unconverged(self.particles, unconverged)

    def _sums(self, state: State, extended: bool) -> dict[str, Any]:
        pairs = self.pairs_at(state)
        found: dict[str, Any] = self.bodies.sums(*self._arrays(state, pairs), extended)
        refused = (found[name] for name in ("crossing", "unconverged"))  # rows, or -1
        self.refuse(
            *(
                pairs.particles[row : row + 1] if row >= 0 else pairs.particles[:0]
                for row in refused
            )
        )
        return found

    def curvature(self, state: State, *, extended: bool = False) -> Curvature:
        """Evaluate all second derivatives; arguments and errors as `evaluate`."""
        found = self.derivatives(state, extended=extended)
        blocks, places = contracted(found), self._places(found)
        r, D = found["separation"], self.particles.dimension

        # The affine strain displaces i relative to j by r_ij.
        by_strain = np.einsum("cij,cj->ci", blocks[:, :, :D], r)
        pulled, used = by_strain[:, places.variable] * places.scale, places.column >= 0
        coupling = np.bincount(places.column[used], pulled[used], self.size).astype(np.float64)
        strain_hessian = float(np.einsum("ci,ci->", by_strain[:, :D], r))
        hessian = self._summed(blocks, places)
        return Curvature(hessian, coupling, strain_hessian)

    def strained(self, state: State, strains: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return second derivatives of the energy by coordinates and by k strains of the box.

        Parameters
        ----------
        state : State
        strains : (k, D, D) array of float64
            Changes of r_i - r_j, linear in it, at fixed orientations.

        Returns
        -------
        (k, n) and (k, k) arrays of float64
            Derivatives of the gradient by each strain, and by two of them.
        """
        found = self.derivatives(
            state
        )  # of the contacts that doubles see, as in factors of the Hessian
        blocks, places = contracted(found), self._places(found)
        D = self.particles.dimension
        moved = np.einsum("kab,cb->kca", strains, found["separation"])
        by_strain = np.einsum("cij,kcj->kci", blocks[:, :, :D], moved)
        used = places.column >= 0
        pulled = [
            np.bincount(
                places.column[used], (one[:, places.variable] * places.scale)[used], self.size
            )
            for one in by_strain
        ]
        own = np.einsum("kci,lci->kl", by_strain[:, :, :D], moved)
        return np.reshape(pulled, (len(strains), self.size)).astype(np.float64), own.astype(
            np.float64
        )

    def rattlers(self, state: State) -> BoolArray:
        """(N,) whether the particle is a rattler (`jamshape.contacts.find_rattlers`)."""
        packing = state.packing(self.particles)
        return find_rattlers(packing, find_contacts(packing, self.k_e, self.sides))

    def derivatives(self, state: State, *, extended: bool = False) -> dict[str, NDArray[Any]]:
        """Return second derivatives of each contact, as the class of `jamshape._contact` does.

        Rows `pair` refer to `particles`, an array (C, 2) that is added here.
        """
        pairs = self.pairs_at(state)
        found: dict[str, NDArray[Any]] = self.bodies.derivatives(
            *self._arrays(state, pairs), extended
        )
        found["particles"] = pairs.particles[found["pair"]]
        found["shift"] = pairs.shift[found["pair"]]
        return found

    @cached_property
    def _length_or_1(self) -> FloatArray:
        return np.where(self.rotation_length > 0, self.rotation_length, 1.0)

    @cached_property
    def column(self) -> IntArray:
        """(N, D + rotations) index of each coordinate, -1 for none."""
        column = np.full(self._free.shape, -1)
        column[self._free] = np.arange(self.size)
        return column

    def _places(self, found: dict[str, NDArray[Any]]) -> _Places:
        D = self.particles.dimension
        i, j = found["particles"].T
        n_turns = self._free.shape[1] - D
        separation, turn_i = np.arange(D), np.arange(D, D + n_turns)
        variable = np.concatenate([separation, turn_i, separation, turn_i + n_turns])
        scale = np.concatenate([np.ones(D), np.zeros(n_turns), -np.ones(D), np.zeros(n_turns)])
        scale = np.tile(scale, (len(i), 1))
        scale[:, D : D + n_turns] = 1 / self._length_or_1[i, None]
        scale[:, 2 * D + n_turns :] = 1 / self._length_or_1[j, None]
        column = np.concatenate([self.column[i], self.column[j]], axis=1)
        return _Places(variable, scale, column)

    def _summed(self, blocks: FloatArray, places: _Places) -> Any:
        """Assemble the blocks (C, v, v) of contacts, v their variables, into one matrix."""
        scale, n = places.scale, self.size
        entries = blocks[:, places.variable[:, None], places.variable]
        entries = entries * scale[:, :, None] * scale[:, None, :]
        row = np.broadcast_to(places.column[:, :, None], entries.shape)
        column = np.broadcast_to(places.column[:, None, :], entries.shape)
        used = (row >= 0) & (column >= 0)
        diagonal = np.arange(n)
        values = np.concatenate([entries[used], np.zeros(n)])
        at = np.concatenate([row[used], diagonal]), np.concatenate([column[used], diagonal])
        return scipy.sparse.csc_matrix((values, at), shape=(n, n))

    def _arrays(self, state: State, pairs: Pairs) -> PairArrays:
        return PairArrays(*state.split, pairs.particles, pairs.shift)

    def pairs_at(self, state: State) -> Pairs:
        """Return the pairs that may touch at a state, rebuilding the list if needed."""
        if self._pairs is None or self._pairs.outrun_by(state, self.turning_radius):
            near = near_particles(state, self.bodies, self.skin)
            self._pairs = Pairs.of(near, state, self.skin, self._reach)
        return self._pairs

    @cached_property
    def skin(self) -> float:
        """Surface distance of pairs that may touch, [length]."""
        return _SKIN * float(self.inner_radius.min())

    @cached_property
    def _reach(self) -> float:
        """Largest distance of the centres of touching particles."""
        return 2 * float(self.bodies.outer_radius.max())


class _Places(NamedTuple):
    """Map from the variables of C contacts to the coordinates."""

    variable: IntArray
    """(v,) variable of each coordinate of two particles."""
    scale: FloatArray
    """(C, v) derivative of the variable by the coordinate."""
    column: IntArray
    """(C, v) index of the coordinate, -1 for none."""


def contracted(found: dict[str, NDArray[Any]]) -> FloatArray:
    """(C, v, v) second derivatives of the energies of contacts."""
    gradient = found["gradient"]
    bonds = np.einsum("cb,cbi,cbj->cij", found["stiffness"], gradient, gradient)
    coupled = np.einsum("cb,cbi->ci", found["coupling"], gradient)
    total: FloatArray = bonds + coupled[:, :, None] * coupled[:, None, :] + found["curvature"]
    return total
