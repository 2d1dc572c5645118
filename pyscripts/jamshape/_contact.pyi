"""Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/.

Bodies are C-contiguous rows: of spherocylinders (M, 6) in 2D, (M, 8) in 3D: centre, unit axis,
half_length, radius; of superellipsoids (M, 6) in 2D, (M, 11) in 3D: centre, angle or quaternion
w i j k, semi-axes, exponent p.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

def spherocylinder_contacts(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64], k_e: float, sides: int
) -> dict[str, NDArray[Any]]: ...
def spine_distances(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64]
) -> NDArray[np.float64]: ...
def spherocylinder_drag(
    half_length: NDArray[np.float64], radius: NDArray[np.float64], dimension: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def find_rattlers(
    n_particles: int,
    dimension: int,
    pairs: NDArray[np.int64],
    normals: NDArray[np.float64],
    flat: NDArray[np.bool_],
) -> NDArray[np.bool_]: ...
def spherocylinder_sums(
    diameters: NDArray[np.float64],
    position: NDArray[np.float64],
    orientation: NDArray[np.float64],
    edges: NDArray[np.float64],
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    k_e: float,
    sides: int,
    extended: bool,
) -> dict[str, Any]: ...
def spherocylinder_derivatives(
    diameters: NDArray[np.float64],
    position: NDArray[np.float64],
    orientation: NDArray[np.float64],
    edges: NDArray[np.float64],
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    k_e: float,
    sides: int,
    extended: bool,
) -> dict[str, NDArray[Any]]: ...
def superellipsoid_contacts(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64], epsilon: float
) -> dict[str, NDArray[Any]]: ...
def superellipsoid_scales(
    bodies_i: NDArray[np.float64],
    bodies_j: NDArray[np.float64],
    normals: NDArray[np.float64] | None = None,
) -> dict[str, NDArray[Any]]: ...
def superellipsoid_near(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64], margin: float
) -> NDArray[np.bool_]: ...
def superellipsoid_motion_sq(
    then: NDArray[np.float64], now: NDArray[np.float64]
) -> NDArray[np.float64]: ...
def superellipsoid_overlap(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64]
) -> NDArray[np.bool_]: ...
def superellipsoid_sums(
    diameters: NDArray[np.float64],
    exponent: NDArray[np.float64],
    position: NDArray[np.float64],
    orientation: NDArray[np.float64],
    edges: NDArray[np.float64],
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    epsilon: float,
    extended: bool,
) -> dict[str, Any]: ...
def superellipsoid_derivatives(
    diameters: NDArray[np.float64],
    exponent: NDArray[np.float64],
    position: NDArray[np.float64],
    orientation: NDArray[np.float64],
    edges: NDArray[np.float64],
    pairs: NDArray[np.int64],
    shift: NDArray[np.int64],
    epsilon: float,
    extended: bool,
) -> dict[str, NDArray[Any]]: ...
def superellipsoid_drag(
    diameters: NDArray[np.float64], exponent: NDArray[np.float64], dimension: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
def superellipsoid_bounding_radius(
    diameters: NDArray[np.float64], exponent: NDArray[np.float64], dimension: int
) -> NDArray[np.float64]: ...
def superellipsoid_sweeps(
    diameters: NDArray[np.float64],
    exponent: NDArray[np.float64],
    position: NDArray[np.float64],
    orientation: NDArray[np.float64],
    edges: NDArray[np.float64],
    shift: float,
    turn: float,
    n_sweeps: int,
    seed: int,
) -> dict[str, Any]: ...

LEAST_SHIFT: float

class SymmetricFactors:
    n_negative: int
    def __init__(
        self, start: NDArray[np.int32], row: NDArray[np.int32], value: NDArray[np.float64]
    ) -> None: ...
    def solve(self, right: NDArray[np.float64]) -> NDArray[np.float64]: ...

class StageUnits:
    force: float
    energy: float
    length: float
    def __init__(self, force: float, energy: float, length: float, n_particles: float) -> None: ...
    def size(
        self,
        shift: NDArray[np.float64],
        force: NDArray[np.float64],
        drag: NDArray[np.float64],
    ) -> float: ...

class StageLimits:
    def __init__(self, accuracy: float, longest_step: float, widest_turn: float) -> None: ...

class Stage:
    def __init__(
        self,
        strain: float,
        drag: NDArray[np.float64],
        centre: NDArray[np.float64],
        extended: bool,
        units: StageUnits,
        limits: StageLimits,
        guess: NDArray[np.float64],
        other: NDArray[np.float64],
    ) -> None: ...

class StageEnd:
    x: NDArray[np.float64]
    sums: tuple[float, NDArray[np.float64], float, float, int, int, int]
    factors: SymmetricFactors | None
    evaluations: int
    factorisations: int
    directions: int
    solved: bool

class _Vicinity:
    def move_to(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        edges: NDArray[np.float64],
    ) -> None: ...
    def take_pairs(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        edges: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        skin: float,
        reach: float,
    ) -> None: ...
    def evaluate(
        self, x: NDArray[np.float64], strain: float, extended: bool
    ) -> tuple[float, NDArray[np.float64], float, float, int, int, int] | None: ...
    def stretch(self, strain: float) -> NDArray[np.float64]: ...
    def factorise(
        self,
        x: NDArray[np.float64],
        strain: float,
        diagonal: NDArray[np.float64],
    ) -> SymmetricFactors: ...
    def solve_stage(
        self,
        stage: Stage,
        factors: SymmetricFactors | None,
        renew: Callable[[NDArray[np.float64], float], None],
    ) -> StageEnd: ...

class SpherocylinderVicinity(_Vicinity):
    def __init__(
        self,
        diameters: NDArray[np.float64],
        k_e: float,
        sides: int,
        column: NDArray[np.int64],
        rotation_length: NDArray[np.float64],
        turning_radius: NDArray[np.float64],
    ) -> None: ...

class SuperellipsoidVicinity(_Vicinity):
    def __init__(
        self,
        diameters: NDArray[np.float64],
        exponent: NDArray[np.float64],
        epsilon: float,
        column: NDArray[np.int64],
        rotation_length: NDArray[np.float64],
        turning_radius: NDArray[np.float64],
    ) -> None: ...
