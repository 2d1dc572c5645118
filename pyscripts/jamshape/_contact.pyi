"""Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/."""

from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

_Floats = NDArray[np.float64]
_Ints = NDArray[np.int32]
_Bools = NDArray[np.bool_]

class _SpherocylinderContacts(TypedDict):
    # M pairs in D dimensions, rotations of 1 component in 2D and 3 in 3D, up to two bonds.
    status: _Ints  # (M,) 0 apart, 1 touching, 2 crossing
    kind: _Ints  # (M,)
    n_bonds: _Ints  # (M,)
    energy: _Floats  # (M,)
    force: _Floats  # (M, D), on i
    torque_i: _Floats  # (M, 1 or 3)
    torque_j: _Floats  # (M, 1 or 3)
    bond_normal: _Floats  # (M, 2, D), into i
    bond_force: _Floats  # (M, 2, D), on i
    bond_arm_i: _Floats  # (M, 2, D)
    bond_distance: _Floats  # (M, 2)
    bond_energy: _Floats  # (M, 2)
    bond_on_side_i: _Bools  # (M, 2)
    bond_on_side_j: _Bools  # (M, 2)

# Bodies are C-contiguous (M, 6) in 2D, (M, 8) in 3D: centre, unit axis, half_length, radius.
def spherocylinder_contacts(
    bodies_i: _Floats, bodies_j: _Floats, k_e: float, sides: int
) -> _SpherocylinderContacts: ...
def spine_distances(bodies_i: _Floats, bodies_j: _Floats) -> _Floats: ...
def spherocylinder_drag(
    half_length: _Floats, radius: _Floats, dimension: int
) -> tuple[_Floats, _Floats]: ...
def find_rattlers(
    n_particles: int, dimension: int, pairs: NDArray[np.int64], normals: _Floats, flat: _Bools
) -> _Bools: ...
