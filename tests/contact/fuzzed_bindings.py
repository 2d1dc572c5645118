"""Calls every binding of jamshape._contact with what it does not expect, in any order; run by test_bindings_survive.py.

``python fuzzed_bindings.py SEED ROUNDS`` ends with exit code 0 and prints how many calls there were of each name, how
many returned and how many were refused; the last line of a process that died names the call.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import resource
import sys
from collections import Counter

import numpy as np

SANITIZED = "JAMSHAPE_CONTACT" in os.environ
if SANITIZED:
    import compiled_elsewhere  # noqa: F401  before anything imports the installed module

from test_refusals import SHAPES, dimensions_of, hard_poses, particles, split

from jamshape import _contact

LEAST, MOST = np.iinfo(np.int64).min, np.iinfo(np.int64).max
NUMBERS = (np.nan, np.inf, -np.inf, 0.0, -0.0, -1.0, 1e-320, 1e-30, 1e30, 1e300)
WHOLE = (0, 1, -1, 2, 3, 7, 2**31 - 1, -(2**31), 2**31, 2**40, 2**63 - 1, -(2**63), 2**64 - 1)
OBJECTS = (None, "", "abc", [], {}, (), b"x", 1 + 2j, object())
if SANITIZED:  # such a module ends where memory is refused, and needs terabytes of addresses itself
    WHOLE = tuple(n for n in WHOLE if n < 2**31 - 1)
WORK = {
    "rounds",
    "n_sweeps",
    "evaluations",
}  # how much is asked for, which takes as long as it takes
MOST_WORK = 7
MOST_BYTES = 3 * 2**30  # what asks for more is refused, as on a machine that has no more


class Fuzz:
    def __init__(self, seed):
        self.random = np.random.default_rng(seed)
        self.counts: dict[str, Counter] = {}

    def one_of(self, things):
        return things[self.random.integers(len(things))]

    def array(self, given):
        """Spoil an array: its size, its kind, its order, or some of its numbers."""
        kind, array = self.random.integers(8), np.array(given)
        if kind == 0:
            return np.zeros([self.one_of((0, 1, 2, 3, 5)) for _ in array.shape], array.dtype)
        if kind == 1:
            return array[: self.random.integers(len(array) + 1)].copy() if array.ndim else array
        if kind == 2:
            return array.astype(self.one_of((np.float32, np.int32, np.complex128, bool, object)))
        if kind == 3:
            return np.asfortranarray(array[..., None])
        if kind == 4:
            return np.zeros(
                self.one_of(((), (0,), (0, 0), (0, 3), (3, 0), (0, 0, 0), (2, 0, 2))), array.dtype
            )
        if array.size:
            values = (LEAST, MOST, -1, 0, 1, 2, 3, 10**6) if array.dtype.kind == "i" else NUMBERS
            array.flat[self.random.integers(array.size)] = self.one_of(values)
        return array

    def spoilt(self, value):
        if isinstance(value, np.ndarray):
            return self.one_of(OBJECTS) if self.random.random() < 0.05 else self.array(value)
        if isinstance(value, bool):
            return self.one_of((True, False, *OBJECTS))
        if isinstance(value, int):
            return self.one_of((*WHOLE, 0.5, *OBJECTS))
        if isinstance(value, float):
            return self.one_of((*NUMBERS, *OBJECTS))
        return self.one_of(OBJECTS) if self.random.random() < 0.5 else value

    def call(self, name, function, **given):
        """Call with some of the arguments spoilt, or with none."""
        part = self.one_of((0.0, 0.0, 0.2, 0.5))
        for key, value in given.items():
            if self.random.random() < part:
                spoilt = self.spoilt(value)
                is_much = key in WORK and isinstance(spoilt, int | float) and spoilt > MOST_WORK
                given[key] = value if is_much else spoilt
        print(name, {k: repr(v)[:300] for k, v in given.items()}, file=sys.stderr, flush=True)
        count = self.counts.setdefault(name, Counter())
        try:
            found = function(**given)
        except (ValueError, TypeError, RuntimeError, MemoryError, OverflowError):
            count["refused"] += 1
            return None
        count["returned"] += 1
        return found


def over_pairs(fuzz, of, given):
    for name in ("contacts", "sums", "derivatives"):
        fuzz.call(name, getattr(of, name), **given, extended=False)
    fuzz.call("near", of.near, **given, margin=0.1)
    fuzz.call("overlaps", of.overlaps, **given)


def of_shapes(fuzz):
    shape = fuzz.one_of(list(SHAPES))
    dimension = fuzz.one_of(dimensions_of(shape))
    rows, form = (np.tile(row, (3, 1)) for row in SHAPES[shape])
    made = fuzz.call(
        "shape", shape, diameters=rows, form=form, dimension=dimension, k_e=1.0, sides=2
    )
    of = particles(shape, dimension) if made is None else made
    with contextlib.suppress(ValueError, RuntimeError):
        for name in (
            "measure",
            "moment",
            "outer_radius",
            "turning_radius",
            "symmetry_axis",
            "director",
        ):
            getattr(of, name)
    given = hard_poses(dimension)
    turns = given["orientation"]
    fuzz.call(
        "host_spin", of.host_spin, orientation=turns, gradient=np.zeros((dimension, dimension))
    )
    fuzz.call("sweeps", of.sweeps, **given, shift=0.1, turn=0.1, n_sweeps=1, seed=1)
    poses = split(
        {k: v for k, v in given.items() if k != "edges"} | {"cell": 30.0 * np.eye(dimension)}
    )
    pairs = {"pairs": np.array([[0, 1], [1, 2]]), "shift": np.zeros((2, dimension), np.int64)}
    over_pairs(fuzz, of, poses | pairs)
    fuzz.call("near_particles", of.near_particles, **poses, margin=0.1)
    return of, dimension, poses


def probes(fuzz, dimension):
    rods = np.zeros((2, 2 * dimension + 2))
    rods[:, dimension], rods[:, -2:], rods[1, 0] = 1.0, (2.0, 1.0), 5.5
    turn = [0.3] if dimension == 2 else [1.0, 0.0, 0.0, 0.0]
    boxes = np.tile([0.0] * dimension + turn + [1.0] * dimension + [2.0], (2, 1))
    boxes[1, 0] = 1.5
    i, j = (
        {"bodies_i": rods[:1], "bodies_j": rods[1:]},
        {"bodies_i": boxes[:1], "bodies_j": boxes[1:]},
    )
    fuzz.call("spherocylinder_contacts", _contact.spherocylinder_contacts, **i, k_e=1.0, sides=2)
    fuzz.call("spine_distances", _contact.spine_distances, **i)
    fuzz.call("superellipsoid_contacts", _contact.superellipsoid_contacts, **j, epsilon=1.0)
    normals = np.ones((1, dimension))
    fuzz.call("superellipsoid_scales", _contact.superellipsoid_scales, **j, normals=normals)
    fuzz.call("superellipsoid_near", _contact.superellipsoid_near, **j, margin=0.1)
    fuzz.call(
        "superellipsoid_motion_sq", _contact.superellipsoid_motion_sq, then=boxes[:1], now=boxes[1:]
    )
    fuzz.call("superellipsoid_overlap", _contact.superellipsoid_overlap, **j)
    fuzz.call(
        "near_spheres", _contact.near_spheres, centre=np.ones((2, dimension)), radius=np.ones(2),
        cell=5.0 * np.eye(dimension),
    )  # fmt: skip
    fuzz.call(
        "elimination_order", _contact.elimination_order,
        position=np.random.default_rng(2).random((20, dimension)), pairs=np.array([[0, 1], [1, 19]]),
    )  # fmt: skip
    fuzz.call("counts_of_team", _contact.counts_of_team, threads=2, first_that_fails=1, rounds=2)
    flat = np.zeros((2, 2), bool)
    pairs, normals = np.array([[0, 1], [1, 2]]), np.ones((2, 3))
    fuzz.call(
        "find_rattlers", _contact.find_rattlers,
        n_particles=3, dimension=dimension, pairs=pairs, normals=normals, flat=flat,
    )  # fmt: skip


def of_vicinity(fuzz, of, dimension, poses):
    """Call the methods of a local energy model in any order, before and after it has a base and pairs."""
    n_turns = 1 if dimension == 2 else 3
    about = fuzz.call("local_energy_model", of.local_energy_model, skin=0.3)
    if about is None:
        of = particles(type(of), dimension)
        about = of.local_energy_model(0.3)
    n, held = 3 * dimension + n_turns * np.count_nonzero(of.rotation_length), {"factors": None}

    def deform():
        matrix = np.stack([np.eye(dimension), np.zeros((dimension, dimension))])
        fuzz.call("deform", about.deform, matrix=matrix, turns=np.zeros((3, n_turns)))

    def factorise():
        found = fuzz.call(
            "factorise", about.factorise, x=np.zeros(n), strain=0.0, diagonal=np.ones(n)
        )
        if found is not None:
            held["factors"] = found
            fuzz.call("Factors.solve", found.solve, right=np.ones((1, n)), nearly=True)

    def newton():
        system = fuzz.call("NewtonSystem", _contact.NewtonSystem, local_model=about, shift=1.0)
        if system is not None:
            for name in fuzz.random.permutation(["prepare", "solve", "learn", "coupling"]):
                if name == "solve":
                    fuzz.call(
                        "NewtonSystem.solve", system.solve, right=np.ones((1, n)), accuracy=1e-3
                    )
                elif name == "learn":
                    fuzz.call("NewtonSystem.learn", system.learn, part=0.5, has_closed=True)
                elif name == "prepare":
                    fuzz.call("NewtonSystem.prepare", system.prepare)
                else:
                    fuzz.call("NewtonSystem.coupling", lambda: system.coupling)

    def solve_stage():
        units = fuzz.call(
            "StageUnits", _contact.StageUnits, force=1.0, energy=1.0, length=1.0, n_particles=3.0
        )
        limits = fuzz.call(
            "StageLimits", _contact.StageLimits, accuracy=1e-6, longest_step=0.1, widest_turn=0.1
        )
        if units is None or limits is None:
            return
        fuzz.call(
            "StageUnits.size", units.size, shift=np.ones(3), force=np.ones(3), drag=np.ones(3)
        )
        stage = fuzz.call(
            "Stage", _contact.Stage, drag=np.ones(n), centre=np.zeros(n), extended=False,
            units=units, limits=limits, guess=np.zeros(n), other=np.zeros(n),
        )  # fmt: skip
        if stage is not None:
            end = fuzz.call(
                "solve_stage",
                about.solve_stage,
                stage=stage,
                factors=held["factors"],
                bonds_of_factors=1,
            )
            kinks = _contact.StageKinks() if end is None else end.kinks
            fuzz.call(
                "mixed_gradient",
                about.mixed_gradient,
                x=np.zeros(n),
                gradient=np.ones(n),
                kinks=kinks,
            )

    def descend():
        stop = fuzz.call(
            "DescentStop", _contact.DescentStop, tolerance=1e-8, lowest=0.0, evaluations=20, seconds=0.1,
            rounding=1e-16, patience=10, newton_below=1e-2, is_near=False, longest_step=0.1, widest_turn=0.1,
        )  # fmt: skip
        if stop is not None:
            end = fuzz.call("descend", about.descend, stop=stop, shift=1.0, tell=lambda _: None)
            if end is not None:
                repr((end.outcome, end.sums, end.rows))

    methods = {
        "move_to": lambda: fuzz.call("move_to", about.move_to, **poses),
        "move": lambda: fuzz.call("move", about.move, x=np.zeros(n), strain=0.0),
        "hold": lambda: fuzz.call("hold", about.hold),
        "deform": deform,
        "poses": lambda: fuzz.call("poses", lambda: about.poses),
        "share": lambda: fuzz.call("share", about.share, threads=2),
        "strain_along": lambda: fuzz.call(
            "strain_along", about.strain_along, axes=np.ones(dimension)
        ),
        "strain derivatives": lambda: fuzz.call(
            "coupling", lambda: (about.coupling, about.strain_curvature)
        ),
        "evaluate": lambda: fuzz.call(
            "evaluate", about.evaluate, x=np.zeros(n), strain=0.0, extended=False
        ),
        "factorise": factorise,
        "forget_pairs": about.forget_pairs,
        "newton": newton,
        "part_within": lambda: fuzz.call(
            "part_within", about.part_within, x=np.ones(n), longest_step=0.1, widest_turn=0.1
        ),
        "stage": solve_stage,
        "descend": descend,
    }
    names = list(methods)
    first = [] if fuzz.random.random() < 0.5 else ["move_to", "forget_pairs", "hold"]
    for name in [*first, *[fuzz.one_of(names) for _ in range(12)]]:
        methods[name]()


def main(seed, rounds):
    faulthandler.enable()
    if not SANITIZED:
        resource.setrlimit(resource.RLIMIT_AS, (MOST_BYTES, MOST_BYTES))
    fuzz = Fuzz(seed)
    for _ in range(rounds):
        of, dimension, poses = of_shapes(fuzz)
        probes(fuzz, dimension)
        of_vicinity(fuzz, of, dimension, poses)
    for name, count in sorted(fuzz.counts.items()):
        print(name, count["returned"], count["refused"])


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
