"""Energy of a packing with its first and second derivatives."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy  # loads its parts once they are used

from jamshape.arguments import checked
from jamshape.arrays import FloatArray, IntArray
from jamshape.checks import require_one_of
from jamshape.contacts import Contacts, sum_forces
from jamshape.front.packing import Packing
from jamshape.front.reading import Held, packing_of
from jamshape.landscape import Landscape, State
from jamshape.records import Record
from jamshape.vibration.hessian import (
    Coordinates,
    DynamicalMatrix,
    all_coordinates,
    hessian_product,
    matrix_at,
)
from jamshape.vibration.statistics import Constraints, constraints

ROTATIONS = ("radian", "half_length", "radius")


@dataclass(frozen=True, eq=False)
class Compatibility(Record):
    """Lengths of the m bonds as functions of c coordinates: H = C^T K C - S.

    Two coupled bonds, of rods side by side, are combined such that K is diagonal; there is one row a bond.

    Parameters
    ----------
    matrix : (m, c) scipy.sparse CSR matrix
        C: derivatives of the lengths, which grow as two particles separate.
    stiffness : (m,) array of float64, [energy / length^2]
        Diagonal of K.
    force : (m,) array of float64, [energy / length]
        Forces along the bonds, positive for repulsion: ``matrix.T @ force`` are the net forces and torques.
    prestress : (c, c) scipy.sparse CSR matrix
        S.
    particles : (m, 2) array of int64
        Rows i <= j of the packing.
    units : (c,) array of float64
        Units in which displacements and rotations are comparable: 1, or what makes a rotation a length, as with
        ``rotation="half_length"``.
    residual : float
        Largest net force or torque over the mean bond force, as of minima.
    """

    matrix: Any
    stiffness: FloatArray
    force: FloatArray
    prestress: Any
    particles: IntArray
    units: FloatArray
    residual: float

    @classmethod
    def of(cls, found: DynamicalMatrix, landscape: Landscape) -> Compatibility:
        """Take the bonds of a dynamical matrix."""
        bonds, root = found.bonds, np.sqrt(found.bonds.stiffness)
        matrix = (scipy.sparse.diags(1 / root) @ found.compatibility).tocsr()
        own, natural = (
            np.linalg.norm(one.direction, axis=1)
            for one in (found.coordinates, all_coordinates(landscape, "half_length"))
        )
        return cls(
            matrix=matrix,
            stiffness=bonds.stiffness,
            force=root * bonds.pull,
            prestress=found.prestress,
            particles=bonds.particles,
            units=natural / own,
            residual=found.residual.largest,
        )

    @cached_property
    def constraints(self) -> Constraints:
        """Rank of C, and number of states of self stress; the unit of rotations does not matter.

        Takes long for tens of thousands of bonds in 3D.
        """
        root, units = (scipy.sparse.diags(x) for x in (np.sqrt(self.stiffness), self.units))
        return constraints((root @ self.matrix @ units).tocsr(), self.residual)


@dataclass(frozen=True, eq=False)
class Energy(Record):
    """Elastic energy of N particles in D dimensions, and its derivatives.

    Parameters
    ----------
    packing : Packing
    U : float, [energy]
    forces : (N, D) array of float64, [energy / length]
        Net force on each particle: -dU/dx.
    torques : (N,) array in 2D, (N, 3) in 3D, of float64, [energy / radian]
        Net torque about each centre: minus the derivative of U with respect to a rotation in radians about z,
        in 3D about the axes x, y, z of space (not of the body).
    pressure_tensor : (D, D) array of float64, [energy / length^D]
        Sum over contacts of f_k r_l over V, with f the force on i and r from j to i: -dU/d(strain_kl)/V, where a
        strain moves x_k by strain_kl x_l at fixed orientations. Positive in compression.
    contacts : Contacts
        As ``packing.contacts()``: ``pairs``, ``force`` and ``energy`` of each contact, and ``bonds`` with ``point``,
        ``normal``, ``overlap``, ``force`` and ``energy`` of each point of contact.
    stress : (N, D, D) array of float64, [energy]
        One half of -f_k r_l of each contact for each of its two particles, negative in compression as
        in LAMMPS's ``compute stress/atom``: the sum over particles is -V times the pressure tensor.
    energies : (N,) array of float64, [energy]
        One half of the energy of each contact for each of its two particles.
    coordinates : Coordinates
        Meaning of the rows of the following, ``particle`` and ``kind`` of each.
    hessian : (c, c) scipy.sparse CSR matrix, or None
        Second derivatives of U by these coordinates, if requested. In 3D they are symmetric: those with respect to rotation
        vectors at no rotation.
    compatibility : Compatibility or None
        If requested.

    Examples
    --------
    >>> import jamshape as js
    >>> discs = js.Packing(
    ...     position=[[2, 5], [2.9, 5]], orientation=[0, 0], diameters=[[1, 1, 1]] * 2,
    ...     species=[1, 1], id=[1, 2], box=js.Box(lo=[0, 0], edges=[10, 10]),
    ... )
    >>> e = js.energy(discs, hessian=True)
    >>> e
    <Energy of 2 particles: U = 0.005, u = 5e-05, pressure = 0.00045, 1 contact, largest net force 1 of the mean bond force>
    >>> e.forces.round(12).tolist()
    [[-0.1, 0.0], [0.1, 0.0]]
    >>> e.hessian.toarray()[0].round(12).tolist()
    [1.0, 0.0, -1.0, 0.0]
    """

    packing: Packing
    U: float
    forces: FloatArray
    torques: FloatArray
    pressure_tensor: FloatArray
    contacts: Contacts
    stress: FloatArray
    energies: FloatArray
    coordinates: Coordinates
    hessian: Any = None
    compatibility: Compatibility | None = None

    @property
    def u(self) -> float:
        """Energy over the box's area (volume), [energy / length^D]."""
        return self.U / self.packing.box.volume

    @property
    def pressure(self) -> float:
        """-dU/dV under isotropic strains at fixed orientations, [energy / length^D]."""
        return float(np.trace(self.pressure_tensor)) / self.packing.dimension

    @property
    def net_force(self) -> float:
        """Largest net force on a particle over the mean magnitude of a bond force; 0 without contacts."""
        bonds = np.linalg.norm(self.contacts.bonds.force, axis=1)
        largest = np.linalg.norm(self.forces, axis=1).max()
        return float(largest / bonds.mean()) if len(bonds) else 0.0

    @cached_property
    def hessian_product(self) -> scipy.sparse.linalg.LinearOperator:
        """(c, c) `scipy.sparse.linalg.LinearOperator` that multiplies the Hessian by a vector, without assembling it.

        Errors are those of `jamshape.energy`.
        """
        landscape, state = Landscape(self.packing), State.of(self.packing)
        return hessian_product(landscape, state, self.coordinates)

    def __repr__(self) -> str:
        n = len(self.contacts)
        said = [f"U = {self.U:.6g}", f"u = {self.u:.4g}", f"pressure = {self.pressure:.4g}"]
        said.append(f"{n} contact{'' if n == 1 else 's'}")
        said.append(f"largest net force {self.net_force:.2g} of the mean bond force")
        return f"<Energy of {self.packing.n} particles: {', '.join(said)}>"


@checked
def energy(
    packing: Held,
    *,
    hessian: bool = False,
    compatibility: bool = False,
    rotation: str = "radian",
) -> Energy:
    """Evaluate the energy of a packing, whether or not it is at a minimum.

    Parameters
    ----------
    packing : Packing, run or path
        Packing, or any file that `jamshape.load` reads, of which the last frame is taken; its law stays.
    hessian : bool
        Also assemble the matrix of second derivatives.
    compatibility : bool
        Also compute derivatives of the bond lengths, with their rank.
    rotation : {"radian", "half_length", "radius"}
        Unit of rotations in the coordinates of both: radians, or lengths, the angle times A (or a), or times R. Torques
        are always per radian.

    Returns
    -------
    Energy

    Raises
    ------
    ValueError
        If a file holds no packing, there is no such unit, or a contact did not converge.
    CrossingError
        If the cores (spines or centres) of two particles cross.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> e = js.energy("packing.h5", hessian=True, compatibility=True)
    >>> e.hessian.shape, e.torques.shape, e.net_force < 1e-6
    ((48, 48), (16,), True)
    >>> e.compatibility.constraints.n_self_stress
    1
    """
    require_one_of("rotation", rotation, ROTATIONS)
    measured = packing_of(packing)
    contacts = measured.contacts()
    landscape, state = Landscape(measured), State.of(measured)
    coordinates = all_coordinates(landscape, rotation)
    wanted = hessian or compatibility
    found = matrix_at(landscape, state, coordinates) if wanted else None
    total, network = sum_forces(measured, contacts.network), contacts.network
    virial = np.einsum("mk,ml->mkl", network.force, network.separation)
    return Energy(
        packing=measured,
        U=total.energy,
        forces=total.force,
        torques=total.torque,
        pressure_tensor=total.virial.T / measured.box.volume,
        contacts=contacts,
        stress=_halved(contacts, -virial),
        energies=_halved(contacts, network.energy),
        coordinates=coordinates,
        hessian=found.matrix if found and hessian else None,
        compatibility=Compatibility.of(found, landscape) if found and compatibility else None,
    )


def _halved(contacts: Contacts, values: FloatArray) -> FloatArray:
    """Sum one half of each contact's values (M, ...) for each of its particles."""
    total = np.zeros((contacts.packing.n, *values.shape[1:]))
    for end in contacts.pairs.T:
        np.add.at(total, end, 0.5 * values)
    return total
