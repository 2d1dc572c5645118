"""Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/.

A class for each shape, with the members of `_Shape`; functions of single pairs are for tests and
measurements of errors.
Their bodies are C-contiguous rows: of spherocylinders (M, 6) in 2D, (M, 8) in 3D: centre, unit axis,
half_length, radius; of superellipsoids (M, 6) in 2D, (M, 11) in 3D: centre, angle or quaternion
w i j k, semi-axes, exponent p.
"""

from collections.abc import Callable
from typing import Any, ClassVar, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

_Reals: TypeAlias = NDArray[np.float64]
_Ints: TypeAlias = NDArray[np.int64]
_Bools: TypeAlias = NDArray[np.bool_]
_Arrays: TypeAlias = dict[str, NDArray[Any]]
_Sums: TypeAlias = tuple[float, _Reals, float, float, int, _Ints, _Ints, _Reals]

class _Shape:
    """Any of the classes; `Shape.compiled` looks them up by name."""

    name: ClassVar[str]
    core: ClassVar[str]
    most_bonds: ClassVar[int]
    has_sides: ClassVar[bool]
    bonds_are_contacts: ClassVar[bool]
    measure: _Reals
    moment: _Reals
    outer_radius: _Reals
    inner_radius: _Reals
    rotation_length: _Reals
    turning_radius: _Reals
    symmetry_axis: _Ints
    director: _Ints
    @overload
    def __init__(
        self,
        diameters: _Reals,
        form: _Reals,
        dimension: int,
        k_e: float,
        sides: int,
        power: float = 2.0,
    ) -> None: ...
    @overload
    def __init__(
        self,
        diameters: _Reals,
        form: _Reals,
        dimension: int,
        k_e: _Reals,
        species: _Ints,
        sides: int,
        power: float = 2.0,
    ) -> None: ...
    @overload
    def __init__(
        self,
        diameters: _Reals,
        exponent: _Reals,
        dimension: int,
        k_e: float,
        sides: int,
        power: float = 2.0,
    ) -> None: ...
    @overload
    def __init__(
        self,
        diameters: _Reals,
        exponent: _Reals,
        dimension: int,
        k_e: _Reals,
        species: _Ints,
        sides: int,
        power: float = 2.0,
    ) -> None: ...
    def host_spin(self, orientation: _Reals, gradient: _Reals) -> _Reals: ...
    def near_particles(
        self, position: _Reals, orientation: _Reals, cell: _Reals, margin: float
    ) -> tuple[_Ints, _Ints]: ...
    def near(
        self,
        position: _Reals,
        orientation: _Reals,
        cell: _Reals,
        pairs: _Ints,
        shift: _Ints,
        margin: float,
    ) -> _Bools: ...
    def overlaps(
        self, position: _Reals, orientation: _Reals, cell: _Reals, pairs: _Ints, shift: _Ints
    ) -> _Bools: ...
    def contacts(
        self,
        position: _Reals,
        orientation: _Reals,
        cell: _Reals,
        pairs: _Ints,
        shift: _Ints,
        extended: bool = False,
        errors: bool = False,
    ) -> _Arrays: ...
    def sums(
        self,
        position: _Reals,
        orientation: _Reals,
        cell: _Reals,
        pairs: _Ints,
        shift: _Ints,
        extended: bool = False,
    ) -> dict[str, Any]: ...
    def derivatives(
        self,
        position: _Reals,
        orientation: _Reals,
        cell: _Reals,
        pairs: _Ints,
        shift: _Ints,
        extended: bool = False,
    ) -> _Arrays: ...
    def insert(
        self,
        edges: _Reals,
        positions: Callable[[int], _Reals],
        orientations: Callable[[int], _Reals],
    ) -> dict[str, Any]: ...
    def sweeps(
        self,
        position: _Reals,
        orientation: _Reals,
        edges: _Reals,
        shift: float,
        turn: float,
        n_sweeps: int,
        seed: int,
    ) -> dict[str, Any]: ...
    def local_energy_model(self, skin: float) -> LocalEnergyModel: ...

def union_moments(discs: _Reals, dimension: int) -> _Reals: ...
def polygon_moments(rounding: float, corners: _Reals) -> _Reals: ...
def boundary_arcs(discs: _Reals) -> _Reals: ...
def elimination_order(position: _Reals, pairs: _Ints) -> _Ints: ...
def find_rattlers(
    n_particles: int, dimension: int, pairs: _Ints, normals: _Reals, flat: _Bools
) -> _Bools: ...
def box_times(
    drag: float, measure: float, stiffness: float, dimension: int
) -> tuple[float, float]: ...
def near_spheres(centre: _Reals, radius: _Reals, cell: _Reals) -> tuple[_Ints, _Ints]: ...
def instruction_sets() -> list[str]: ...
def sparse_product(
    first: _Ints, column: _Ints, value: _Reals, dense: _Reals, is_long: bool
) -> _Reals: ...
def spherocylinder_contacts(
    bodies_i: _Reals, bodies_j: _Reals, k_e: float, sides: int, power: float = 2.0
) -> _Arrays: ...
def spine_distances(bodies_i: _Reals, bodies_j: _Reals) -> _Reals: ...
def superellipsoid_contacts(
    bodies_i: _Reals, bodies_j: _Reals, epsilon: float, extended: bool = False, errors: bool = False
) -> _Arrays: ...
def superellipsoid_scales(
    bodies_i: _Reals, bodies_j: _Reals, normals: _Reals | None = None
) -> _Arrays: ...
def superellipsoid_near(bodies_i: _Reals, bodies_j: _Reals, margin: float) -> _Bools: ...
def superellipsoid_motion_sq(then: _Reals, now: _Reals) -> _Reals: ...
def counts_of_team(threads: int, first_that_fails: int, rounds: int) -> tuple[_Ints, str]: ...
def superellipsoid_overlap(bodies_i: _Reals, bodies_j: _Reals) -> _Bools: ...

LEAST_SHIFT: float

class Factors:
    def solve(self, right: _Reals, nearly: bool = ...) -> _Reals: ...

class StageUnits:
    force: float
    energy: float
    length: float
    def __init__(self, force: float, energy: float, length: float, n_particles: float) -> None: ...
    def size(self, shift: _Reals, force: _Reals, drag: _Reals) -> float: ...

class StageLimits:
    def __init__(self, accuracy: float, longest_step: float, widest_turn: float) -> None: ...

class Stage:
    def __init__(
        self,
        drag: _Reals,
        centre: _Reals,
        extended: bool,
        units: StageUnits,
        limits: StageLimits,
        guess: _Reals,
        other: _Reals,
    ) -> None: ...

class StageKinks:
    particles: list[tuple[int, int]]
    weights: list[float]
    def __init__(self) -> None: ...
    def __len__(self) -> int: ...

class StageEnd:
    x: _Reals
    sums: _Sums
    factors: Factors | None
    bonds_of_factors: int
    kinks: StageKinks
    evaluations: int
    factorisations: int
    directions: int
    solved: bool

class DescentStop:
    def __init__(
        self,
        tolerance: float,
        lowest: float,
        evaluations: int,
        seconds: float,
        rounding: float,
        patience: int,
        newton_below: float,
        is_near: bool,
        longest_step: float,
        widest_turn: float,
    ) -> None: ...

class DescentEnd:
    outcome: str
    sums: _Sums
    rows: list[tuple[float, int, float, float]]
    evaluations: int
    factorisations: int
    products: int

class NewtonSystem:
    coupling: _Reals
    shift: float
    def __init__(self, local_model: LocalEnergyModel, shift: float) -> None: ...
    def prepare(self) -> None: ...
    def solve(self, right: _Reals, accuracy: float) -> _Reals: ...
    def learn(self, part: float, has_closed: bool) -> None: ...

class LocalEnergyModel:
    poses: tuple[_Reals, _Reals, _Reals]
    coupling: _Reals
    strain_curvature: float
    def strain_along(self, axes: _Reals) -> None: ...
    def move_to(self, position: _Reals, orientation: _Reals, cell: _Reals) -> None: ...
    def move(self, x: _Reals, strain: float) -> tuple[_Reals, _Reals, _Reals]: ...
    def hold(self) -> None: ...
    def deform(self, matrix: _Reals, turns: _Reals) -> None: ...
    def forget_pairs(self) -> None: ...
    def share(self, threads: int) -> None: ...
    def follow_bodies(self) -> None: ...
    def evaluate(self, x: _Reals, strain: float, extended: bool) -> _Sums: ...
    def part_within(self, x: _Reals, longest_step: float, widest_turn: float) -> float: ...
    def factorise(self, x: _Reals, strain: float, diagonal: _Reals) -> Factors: ...
    def solve_stage(
        self,
        stage: Stage,
        factors: Factors | None,
        bonds_of_factors: int,
        kinks: StageKinks = ...,
    ) -> StageEnd: ...
    def mixed_gradient(self, x: _Reals, gradient: _Reals, kinks: StageKinks) -> _Reals: ...
    def descend(
        self,
        stop: DescentStop,
        shift: float,
        tell: Callable[[tuple[float, int, float, float]], None],
    ) -> DescentEnd: ...
