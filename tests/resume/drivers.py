"""Small runs of every driver: a table of calls, what identifies them, and how to start one in a process of its own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from killing import forked

import jamshape as js
from jamshape.files.h5md import write_packing
from jamshape.flow.host import Host
from jamshape.landscape import Landscape, State
from jamshape.protocols.quasistatic import compressed_to
from jamshape.protocols.random_start import random_packing

RECORDER = "jamshape.recording.recorder"
EVERY = ((f"{RECORDER}.PAUSE", 0.0), (f"{RECORDER}.SECONDS", 0.0))
"""Checkpoints at every mark."""
NONE = ((f"{RECORDER}.PAUSE", 1e9), (f"{RECORDER}.SECONDS", 1e9))
"""No checkpoint before the end."""
SHORT = (
    ("jamshape.flow.implicit_driver.STEPS_PER_MARK", 40),
    ("jamshape.flow.lammps_driver.EVALUATIONS_PER_MARK", 800),
)
"""Marks close to each other."""
FAR = (
    ("jamshape.flow.implicit_driver.STEPS_PER_MARK", 10**9),
    ("jamshape.flow.lammps_driver.EVALUATIONS_PER_MARK", 10**15),
)
"""No marks before the end, where marks can be placed."""

RODS = js.Spherocylinders(alpha=1)
DISCS = js.Spherocylinders(alpha=0.01)
DIMERS = js.Dimers(alpha=1)
BODIES = js.Superellipsoids(w1=0.6)


# --- starts ---------------------------------------------------------------------------------------


def dense(particles: js.Particles, n: int, phi: float, dimension: int = 2) -> js.Packing:
    """Compress particles quasistatically."""
    start = random_packing(n, 0.3 if dimension == 2 else 0.1, 1, particles, dimension)
    return compressed_to(Landscape(start), State.of(start), phi, 1e-2).packing(start)


def tilted() -> js.Packing:
    """Return discs in a box that is about to take other cell vectors."""
    packing = dense(DISCS, 12, 0.86)
    return (
        State.of(packing).deformed(Host.shearing(0.5, "simple").deformation(1.1)).packing(packing)
    )


STARTS: Mapping[str, Callable[[], js.Packing]] = {
    "rods": lambda: dense(RODS, 12, 0.82),
    "discs": tilted,
    "dimers": lambda: dense(DIMERS, 12, 0.86),
    "bodies": lambda: dense(BODIES, 8, 0.75, 3),
}


def write_start(folder: Path, name: str) -> Path:
    """Write the start of this name, once."""
    path = folder / f"{name}.h5"
    if not path.exists():
        write_packing(path, STARTS[name]())
    return path


# --- runs -----------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A call that records a run in a second.

    Parameters
    ----------
    function
        Name in `jamshape`.
    particles
        Particles, or the name of a start.
    settings
    others
        Other values of arguments, with which the file is refused.
    long
        Settings with which it takes minutes.
    start
        Argument for the start.
    """

    function: str
    particles: js.Particles | str
    settings: Mapping[str, Any]
    others: Mapping[str, Any] = field(default_factory=dict)
    long: Mapping[str, Any] = field(default_factory=dict)
    start: str = "start"

    def run(self, file: Path, starts: Path, **more: Any) -> Any:
        """Record, resume or load the run in a file."""
        given = dict(self.settings) | {"progress": False} | more
        if isinstance(self.particles, str):
            given = {"start": write_start(starts, self.particles)} | given
            given[self.start] = given.pop("start")
            return getattr(js, self.function)(file=file, **given)
        return getattr(js, self.function)(self.particles, file=file, **given)


def run_case(name: str, file: Path, starts: Path, more: Mapping[str, Any]) -> None:
    """Call `Case.run` in another process."""
    CASES[name].run(file, starts, **more)


def resume(file: Path) -> None:
    """Resume by the file alone."""
    js.resume(file, progress=False)


def started(
    name: str, file: Path, starts: Path, patches: Any = (), fuse: int = 0, **more: Any
) -> Any:
    """Start a case in a process of its own."""
    write_start(starts, CASES[name].particles) if isinstance(CASES[name].particles, str) else None
    log = file.parent / "said.log"
    return forked(run_case, (name, file, starts, more), log, (*SHORT, *patches), fuse)


_ROWS = {"rows": 40, "frames": 5}

DRIVERS = {
    "compression in LAMMPS": Case(
        "compress", RODS,
        {"n": 16, "phi": (0.5, 0.86), "kappa": 1e-3, **_ROWS},
        {"n": 17, "phi": (0.5, 0.87), "kappa": 2e-3, "p_end": 0.5, "seed": 2, "rows": 41, "frames": 4,
         "integrator": "heun/adaptive", "integration_tolerance": 1e-3, "sides": 1},
        {"kappa": 1e-6, "rows": 100_000},
    ),
    "shear in LAMMPS": Case(
        "shear", "rods",  # its box tilts, and takes other cell vectors
        {"gdot": 1e-2, "strain": 1.2, **_ROWS},
        {"gdot": 2e-2, "strain": 1.3, "flow": "pure", "rows": 41, "frames": 4, "integrator": "heun/adaptive",
         "integration_tolerance": 1e-3, "sides": 1},
        {"strain": 4000.0, "rows": 100_000},
    ),
    "cyclic shear in LAMMPS": Case(
        "cyclic_shear", "rods",  # its box takes other cell vectors, to and fro
        {"amplitude": 0.6, "period": 240.0, "cycles": 2, "rows": 4},
        {"amplitude": 0.5, "period": 250.0, "cycles": 3, "flow": "pure", "rows": 16, "frames": 1,
         "integrator": "heun/adaptive", "integration_tolerance": 1e-3, "sides": 1},
        {"period": 4e7, "rows": 1_000_000},
    ),
    "implicit compression": Case(
        "slow_compress", DIMERS,
        {"n": 8, "phi": (0.7, 0.82), "kappa": 1e-3},
        {"n": 9, "phi": (0.7, 0.83), "kappa": 2e-3, "seed": 2, "p_end": 0.5, "method": "sdirk2",
         "integration_tolerance": 1e-2, "largest_drop": 0.5},
        {"integration_tolerance": 1e-10},
    ),
    "implicit shear": Case(
        "shear", "discs",
        {"gdot": 1e-3, "strain": 0.12, "integrator": "tr-bdf2", "integration_tolerance": 1e-2, "rows": 20},
        {"gdot": 2e-3, "strain": 0.13, "flow": "pure", "integration_tolerance": 2e-2, "rows": 120, "integrator": "sdirk2"},
        {"strain": 1000.0, "rows": 100_000},
    ),
    "quasistatic shear": Case(
        "quasistatic_shear", "dimers",
        {"step": 2e-2, "strain": 0.1, "frames": 5},
        {"step": 1e-2, "strain": 0.5, "flow": "pure", "pressure": 1e-3, "tolerance": 1e-9, "frames": 4},
        {"step": 1e-3, "strain": 1000.0},
    ),
    "ladder": Case(
        "ladder", "dimers", {"u0": (1e-4, 1e-5, 1e-6, 3e-6, 1e-5, 1e-4)},
        {"u0": (1e-4, 1e-5), "accuracy": 1e-6, "tolerance": 1e-9},
        {"u0": tuple(float(u) for k in range(3000) for u in (1e-4, 1e-5))},
        "packing",
    ),
}  # fmt: skip
"""One case for each driver."""
# make_packing: its case belongs here.

CASES = DRIVERS | {
    "compression by equal steps": Case(
        "compress", DIMERS, {"n": 16, "phi": (0.5, 0.86), "kappa": 1e-3, "dt": 0.1, **_ROWS}
    ),
    "compression to a pressure": Case(
        "compress", DIMERS, {"n": 16, "phi": (0.5, 1.2), "kappa": 1e-3, "p_end": 2e-2, "rows": 80, "frames": 5}
    ),
    "compression of a mixture": Case(
        "compress", js.Spherocylinders(alpha=[0, 2], size=[1, 1.4]),
        {"n": 16, "phi": (0.5, 0.86), "kappa": 1e-3, "sides": 1, "integrator": "heun/adaptive", **_ROWS},
    ),
    "compression in space": Case(
        "compress", BODIES, {"dimension": 3, "n": 8, "phi": (0.2, 0.7), "kappa": 2e-3, **_ROWS}
    ),
    "shear in space": Case("shear", "bodies", {"gdot": 1e-2, "strain": 0.9, **_ROWS}),
    "shear in LAMMPS at a pressure": Case(
        "shear", "rods", {"gdot": 1e-2, "strain": 1.2, "pressure": 1e-2, "t_box": 20.0, **_ROWS}
    ),
    "cyclic shear in LAMMPS at a pressure": Case(
        "cyclic_shear", "rods",  # its box takes other cell vectors, to and fro
        {"amplitude": 0.6, "period": 240.0, "cycles": 2, "rows": 12, "pressure": 1e-2},
    ),
    "implicit shear at a pressure": Case(
        "shear", "discs",
        {"gdot": 1e-3, "strain": 0.12, "pressure": 1e-2, "t_box": 20.0, "integrator": "tr-bdf2",
         "integration_tolerance": 1e-2, "rows": 20},
        {"pressure": 2e-2, "t_box": 30.0},
    ),
    "implicit shear in space at a pressure": Case(
        "shear", "bodies",
        {"gdot": 1e-3, "strain": 0.06, "pressure": 1e-2, "t_box": 20.0, "integrator": "sdirk2",
         "integration_tolerance": 1e-2, "rows": 20},
    ),
    "pure shear in LAMMPS": Case(
        "shear", "dimers", {"gdot": 1e-2, "strain": 0.5, "flow": "pure", "dt": 0.1, **_ROWS}
    ),
    "cyclic pure shear in space": Case(
        "cyclic_shear", "bodies",
        {"amplitude": 0.1, "period": 40.0, "cycles": 2, "flow": "pure", "dt": 0.1, "rows": 8},
    ),
    "implicit compression at two rates": Case(
        "slow_compress", "dimers",
        {"phi": (None, 0.87), "kappa": ((0.0, 1e-4), (0.865, 1e-5)), "method": "sdirk2"},
    ),
    "implicit pure shear": Case(
        "shear", "rods",
        {"gdot": 1e-3, "strain": 0.05, "flow": "pure", "integrator": "tr-bdf2", "integration_tolerance": 1e-2, "rows": 20},
    ),
    "implicit compression in space": Case(
        "slow_compress", "bodies", {"phi": (None, 0.8), "kappa": 1e-5, "integration_tolerance": 1e-5},
    ),
    "implicit shear in space": Case(
        "shear", "bodies",
        {"gdot": 1e-3, "strain": 0.06, "integrator": "tr-bdf2", "integration_tolerance": 1e-2, "rows": 20},
    ),
    "quasistatic pure shear at a pressure": Case(
        "quasistatic_shear", "dimers",
        {"step": 4e-3, "strain": 0.04, "flow": "pure", "pressure": 1e-3, "frames": 3},
    ),
    "cyclic quasistatic shear": Case(
        "quasistatic_shear", "dimers", {"step": 1e-2, "amplitude": 0.06, "cycles": 2, "frames": 3},
        {"step": 2e-2, "amplitude": 0.05, "cycles": 3},
    ),
    "quasistatic shear at a normal stress": Case(
        "quasistatic_shear", "dimers", {"step": 4e-3, "strain": 0.04, "pressure": 1e-3, "box": "yy", "frames": 3},
    ),
    "quasistatic shear by the stress": Case(
        "quasistatic_shear", "dimers", {"stress_step": 6e-4, "strain": 0.08, "frames": 3},
        {"stress_step": 7e-4},
    ),
    "ladder in pressure": Case(
        "ladder", "dimers", {"pressure": (1e-3, 1e-4, 1e-3), "box": "free"},
        {"pressure": (1e-3, 1e-4), "box": "isotropic"}, {}, "packing",
    ),
    "quasistatic shear in space": Case(
        "quasistatic_shear", "bodies", {"step": 1e-2, "strain": 0.1, "frames": 3}
    ),
}  # fmt: skip
