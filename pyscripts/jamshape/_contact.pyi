"""Contact geometry and energies: arrays in, arrays out, over lammps_plugin/contact/.

A class for each shape; functions that rest on single pairs are for tests and measurements of errors.
Their bodies are C-contiguous rows: of spherocylinders (M, 6) in 2D, (M, 8) in 3D: centre, unit axis,
half_length, radius; of superellipsoids (M, 6) in 2D, (M, 11) in 3D: centre, angle or quaternion
w i j k, semi-axes, exponent p.
"""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

class _Shape:
    name: ClassVar[str]
    core: ClassVar[str]
    most_bonds: ClassVar[int]
    has_sides: ClassVar[bool]
    bonds_are_contacts: ClassVar[bool]
    measure: NDArray[np.float64]
    moment: NDArray[np.float64]
    outer_radius: NDArray[np.float64]
    inner_radius: NDArray[np.float64]
    rotation_length: NDArray[np.float64]
    turning_radius: NDArray[np.float64]
    symmetry_axis: NDArray[np.int64]
    director: NDArray[np.int64]
    def __init__(
        self,
        diameters: NDArray[np.float64],
        exponent: NDArray[np.float64],
        dimension: int,
        k_e: float,
        sides: int,
    ) -> None: ...
    def host_spin(
        self, orientation: NDArray[np.float64], gradient: NDArray[np.float64]
    ) -> NDArray[np.float64]: ...
    def near(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        margin: float,
    ) -> NDArray[np.bool_]: ...
    def overlaps(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
    ) -> NDArray[np.bool_]: ...
    def contacts(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        extended: bool = False,
        errors: bool = False,
    ) -> dict[str, NDArray[Any]]: ...
    def sums(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        extended: bool = False,
    ) -> dict[str, Any]: ...
    def derivatives(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        extended: bool = False,
    ) -> dict[str, NDArray[Any]]: ...
    def insert(
        self,
        edges: NDArray[np.float64],
        positions: Callable[[int], NDArray[np.float64]],
        orientations: Callable[[int], NDArray[np.float64]],
        most_attempts: int,
    ) -> dict[str, Any]: ...
    def sweeps(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        edges: NDArray[np.float64],
        shift: float,
        turn: float,
        n_sweeps: int,
        seed: int,
    ) -> dict[str, Any]: ...
    def vicinity(
        self,
        column: NDArray[np.int64],
        rotation_length: NDArray[np.float64],
        turning_radius: NDArray[np.float64],
    ) -> Vicinity: ...

class Spherocylinders(_Shape): ...
class Superellipsoids(_Shape): ...
class Dimers(_Shape): ...

def find_rattlers(
    n_particles: int,
    dimension: int,
    pairs: NDArray[np.int64],
    normals: NDArray[np.float64],
    flat: NDArray[np.bool_],
) -> NDArray[np.bool_]: ...
def instruction_sets() -> list[str]: ...
def spherocylinder_contacts(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64], k_e: float, sides: int
) -> dict[str, NDArray[Any]]: ...
def spine_distances(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64]
) -> NDArray[np.float64]: ...
def superellipsoid_contacts(
    bodies_i: NDArray[np.float64],
    bodies_j: NDArray[np.float64],
    epsilon: float,
    extended: bool = False,
    errors: bool = False,
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
def counts_of_team(
    threads: int, first_that_fails: int, rounds: int
) -> tuple[NDArray[np.int64], str]: ...
def superellipsoid_overlap(
    bodies_i: NDArray[np.float64], bodies_j: NDArray[np.float64]
) -> NDArray[np.bool_]: ...

LEAST_SHIFT: float

class Factors:
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
    factors: Factors | None
    bonds_of_factors: int
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
        newton_below: float,
        is_near: bool,
        longest_step: float,
        widest_turn: float,
    ) -> None: ...

class DescentEnd:
    outcome: str
    sums: tuple[float, NDArray[np.float64], float, float, int, int, int]
    rows: list[tuple[float, int, float, float]]
    evaluations: int
    factorisations: int
    products: int

class NewtonSystem:
    coupling: NDArray[np.float64]
    shift: float
    def __init__(self, vicinity: Vicinity, shift: float) -> None: ...
    def prepare(self) -> None: ...
    def solve(self, right: NDArray[np.float64], accuracy: float) -> NDArray[np.float64]: ...
    def learn(self, tries: int) -> None: ...

class Vicinity:
    poses: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    def move_to(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
    ) -> None: ...
    def move(
        self, x: NDArray[np.float64], strain: float
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
    def hold(self) -> None: ...
    def deform(self, matrix: NDArray[np.float64], turns: NDArray[np.float64]) -> None: ...
    def take_pairs(
        self,
        position: NDArray[np.float64],
        orientation: NDArray[np.float64],
        cell: NDArray[np.float64],
        pairs: NDArray[np.int64],
        shift: NDArray[np.int64],
        wide: float,
        reach: float,
        skin: float,
    ) -> None: ...
    def share(self, threads: int) -> None: ...
    def evaluate(
        self, x: NDArray[np.float64], strain: float, extended: bool
    ) -> tuple[float, NDArray[np.float64], float, float, int, int, int] | None: ...
    def part_within(
        self, x: NDArray[np.float64], longest_step: float, widest_turn: float
    ) -> float: ...
    def factorise(
        self,
        x: NDArray[np.float64],
        strain: float,
        diagonal: NDArray[np.float64],
    ) -> Factors: ...
    def solve_stage(
        self,
        stage: Stage,
        factors: Factors | None,
        bonds_of_factors: int,
        renew: Callable[[NDArray[np.float64], float], None],
    ) -> StageEnd: ...
    def descend(
        self,
        stop: DescentStop,
        shift: float,
        renew: Callable[[NDArray[np.float64], float], None],
        tell: Callable[[tuple[float, int, float, float]], None],
    ) -> DescentEnd: ...
