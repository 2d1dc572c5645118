"""Compression through jamming, driven in LAMMPS (Marschall & Teitel 2018, Sec. II)."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from jamshape.files.h5md import RunWriter, read_attributes, read_observables, read_series
from jamshape.measures.onset import fit_onset
from jamshape.packing import Packing

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from jamshape.lammps.session import Session

# Columns of `compute packing` and elements of `fix overdamped/affine`, as their doc comments list them.
_PACKING = {
    "phi": 0, "u": 1, "p": 2, "z": 3, "S_2": 4, "S_4": 5, "fmax": 6, "frms": 7,
    "z_single": 8, "rattlers": 9, "bonds": 10, "overlap": 11, "tmax": 12,
}  # fmt: skip
_FLOW = {"strain": 1, "lambda_max": 2, "dt_max": 3, "evaluations": 5, "step_error": 7}
_SUBSTEPS = {"substeps": 8, "rejected": 9, "forced": 10, "substep": 11, "substep_shortest": 12,
             "local_error": 13, "stages": 14, "overlap_length": 15}  # fmt: skip

_LONGEST_RUN = 1_000_000_000  # steps in one `run` command, which counts in 32 bits


@dataclass(frozen=True)
class Compression:
    """How to compress.

    Parameters
    ----------
    kappa
        Rate, dL/dt = -kappa L, [1/time]; negative to open the box.
    phi_end
        Packing fraction to reach.
    dt
        Time step, [time]; an integrator that chooses its own steps divides it as it needs.
    sides
        Bonds of a side-to-side contact, 1 or 2.
    k_e, k_d
        Stiffness [energy] and drag [energy time / length^(D + 2)].
    integrator
        A name that `fix overdamped/affine` knows; all but ``heun`` choose their own steps.
    tolerance
        Of those: local error over the typical overlap.

    Raises
    ------
    ValueError
        If a rate, step, stiffness, drag or tolerance is not positive, or `sides` neither 1 nor 2.
    """

    kappa: float = 1e-4
    phi_end: float = 0.9
    dt: float = 0.05
    sides: int = 1
    k_e: float = 1.0
    k_d: float = 1.0
    integrator: str = "heun"
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        if not (math.isfinite(self.kappa) and self.kappa != 0):
            msg = f"kappa is {self.kappa}, expected a rate other than zero."
            raise ValueError(msg)
        for name in ("phi_end", "dt", "k_e", "k_d", "tolerance"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                msg = f"{name} is {value}, expected a positive number."
                raise ValueError(msg)
        if self.sides not in (1, 2):
            msg = f"sides is {self.sides}, expected 1 or 2."
            raise ValueError(msg)

    @property
    def chooses_steps(self) -> bool:
        """Whether the integrator divides the time step as accuracy asks."""
        return self.integrator != "heun"

    def in_steps(self, phi: float, steps: int) -> Compression:
        """Return the same with a time step of which so many lead from `phi` to the end."""
        strain = math.log(self.phi_end / phi) / 2
        return dataclasses.replace(self, dt=strain / (self.kappa * steps))

    def steps(self, phi: float) -> int:
        """Count the time steps from packing fraction `phi` to `phi_end`."""
        strain = math.log(self.phi_end / phi)
        return max(0, math.ceil(strain / (2 * self.kappa * self.dt) - 1e-6))


@dataclass(frozen=True)
class Row:
    """One row of a compression: where it is and what it measures."""

    step: int
    time: float
    wall_seconds: float
    observables: dict[str, float]


class CompressionRun:
    """A compression in a LAMMPS session, from a packing or from a restart file.

    Parameters
    ----------
    session
        A fresh one.
    settings
    start
        The state to begin with, or the path of a restart file of an earlier run.
    time
        Of that state; step times time step when left out.

    Raises
    ------
    ValueError
        If the state is already denser than `settings.phi_end`.
    """

    def __init__(
        self,
        session: Session,
        settings: Compression,
        start: Packing | str | Path,
        time: float | None = None,
    ) -> None:
        self.session, self.settings = session, settings
        self._began = perf_counter()
        self._time, self._step_of_time = 0.0, 0
        if isinstance(start, Packing):
            session.load(start)
        else:
            session.load_restart(start)
        self._set_up()
        phi = self.measure()["phi"]
        if phi > settings.phi_end:
            msg = f"The state has phi = {phi:.6g}, expected one below phi_end = {settings.phi_end}."
            raise ValueError(msg)
        self.last_step = session.step + settings.steps(phi)
        if time is not None:
            self._time, self._step_of_time = time, session.step

    def _set_up(self) -> None:
        s = self.settings
        self.session.commands(f"""
            pair_style spherocylinder/harmonic sides {("one", "two")[s.sides - 1]}
            pair_coeff * * {s.k_e!r}
            {self.session.neighbours()}
            {self._fix()}
            timestep {s.dt!r}
            compute packing all packing
            thermo_style custom step c_packing[1]
            thermo_modify norm no lost error
            run 0 post no
        """)

    def _fix(self) -> str:
        s = self.settings
        return (
            f"fix flow all overdamped/affine drag {s.k_d!r} compress {s.kappa!r}"
            f" integrator {s.integrator}"
            f"{f' tolerance {s.tolerance!r}' if s.chooses_steps else ''}"
        )

    def change(self, kappa: float | None = None, dt: float | None = None) -> None:
        """Go on with another rate or time step."""
        self._time, self._step_of_time = self.time, self.session.step
        old = self.settings
        self.settings = dataclasses.replace(old, kappa=kappa or old.kappa, dt=dt or old.dt)
        self.session.commands(
            f"unfix flow\n{self._fix()}\ntimestep {self.settings.dt!r}\nrun 0 post no"
        )

    @property
    def time(self) -> float:
        """Since the start, also if the time step has changed."""
        return self._time + (self.session.step - self._step_of_time) * self.settings.dt

    def keep_restarts(self, every: int, path: Path) -> None:
        """Write restart files `path`.a and `path`.b in turn, every so many steps."""
        self.session.commands(f"restart {every} {path}.a {path}.b")

    def write_restart(self, path: Path) -> None:
        """Write a LAMMPS restart file of the present state."""
        # It moves atoms into the box and orders them anew, which neighbour lists must follow.
        self.session.commands(f"write_restart {path}\nrun 0 post no")

    def samples(self, every: int) -> Iterator[Row]:
        """Run to the end and yield a row at each multiple of `every` steps, and at the end."""
        while self.session.step < self.last_step:
            self.advance(min(self.last_step, (self.session.step // every + 1) * every))
            yield self.sample()

    def advance(self, step: int) -> None:
        """Run to `step`."""
        while self.session.step < step:
            steps = min(step - self.session.step, _LONGEST_RUN)
            self.session.commands(f"run {steps} pre no post no")

    def sample(self) -> Row:
        """Measure the present state."""
        step = self.session.step
        wall = perf_counter() - self._began
        return Row(step, self.time, wall, self.measure())

    def measure(self) -> dict[str, float]:
        """Return observables of the present state, named as in `compute packing`."""
        lmp = self.session.lmp
        values = lmp.extract_compute("packing", 0, 1)
        found = {name: float(values[column]) for name, column in _PACKING.items()}
        flow = _FLOW | _SUBSTEPS if self.settings.chooses_steps else _FLOW
        found |= {name: float(lmp.extract_fix("flow", 0, 1, k)) for name, k in flow.items()}
        return found

    def packing(self) -> Packing:
        """Return the present state, sorted by ID."""
        return self.session.packing(self.time)


@dataclass(frozen=True)
class Recording:
    """What a compression leaves in its H5MD file.

    Parameters
    ----------
    path
        The file; restart files lie beside it, as ``path.restart.a`` and ``.b``.
    rows, frames
        How many samples of the observables and how many snapshots, over the whole run.
    attributes
        Stored with the run, beside its settings: what made the initial state.
    """

    path: Path
    rows: int = 400
    frames: int = 20
    attributes: Mapping[str, Any] = field(default_factory=dict)

    @property
    def restart_prefix(self) -> Path:
        """Path of the restart files without their last letter."""
        return self.path.with_name(self.path.name + ".restart")

    def newest_restart(self) -> Path:
        """Find the last restart file of a run that was killed.

        Raises
        ------
        FileNotFoundError
            When there is none.
        """
        paths = [Path(f"{self.restart_prefix}.{end}") for end in "ab"]
        found = [path for path in paths if path.is_file()]
        if not found:
            msg = f"Found neither {paths[0]} nor {paths[1].name}, expected one: start anew."
            raise FileNotFoundError(msg)
        return max(found, key=lambda path: path.stat().st_mtime)


def is_finished(path: Path) -> bool:
    """Whether the file holds a compression that reached its end."""
    return path.exists() and bool(read_attributes(path).get("finished"))


def begin(session: Session, settings: Compression, start: Packing, to: Recording) -> CompressionRun:
    """Start a compression and its file."""
    run = CompressionRun(session, settings, start)
    attributes = dataclasses.asdict(settings) | dict(to.attributes)
    attributes |= {"phi_start": start.phi, "rows": to.rows, "frames": to.frames, "finished": False}
    attributes["left_out"] = session.left_out()
    RunWriter.create(to.path, run.packing(), attributes, run.measure())
    return run


def resume(session: Session, path: Path) -> tuple[CompressionRun, Recording]:
    """Go on with a compression that was killed, from its last restart file, as it was set."""
    stored = read_attributes(path)
    names = {f.name for f in dataclasses.fields(Compression)} & set(stored)
    settings = Compression(**{name: stored[name] for name in names})
    to = Recording(path, int(stored["rows"]), int(stored["frames"]))
    run = CompressionRun(session, settings, to.newest_restart())
    RunWriter.open(path).truncate(session.step)
    return run, to


def record(run: CompressionRun, to: Recording) -> Iterator[Row]:
    """Run to the end, writing each sample to the file before it is yielded."""
    writer = RunWriter.open(to.path)
    whole = run.settings.steps(float(read_attributes(to.path)["phi_start"]))
    every = max(1, whole // to.rows)
    per_frame = every * max(1, to.rows // to.frames)
    name_of_error = "local_error" if run.settings.chooses_steps else "step_error"
    run.keep_restarts(per_frame, to.restart_prefix)

    def keep(sample: Row) -> Row:
        if sample.step % per_frame == 0 or sample.step == run.last_step:
            writer.append(run.packing(), sample.observables)
        else:
            writer.append_observables(sample.step, sample.time, sample.observables)
        error = sample.observables[name_of_error]
        writer.append_report(sample.step, sample.wall_seconds, error)
        return sample

    # A restart file is older than the row of its step, which a kill may have cut off.
    if run.session.step > read_series(to.path, "p").step[-1]:
        yield keep(run.sample())
    for sample in run.samples(every):
        yield keep(sample)
    writer.set_attributes({"finished": True})


def summary(path: Path) -> dict[str, object]:
    """Summarise a run: its end and, where the pressure rises, the onset of jamming."""
    observables = read_observables(path)
    last: dict[str, object] = {
        name: float(observables[name][-1]) for name in ("phi", "p", "z", "S_2", "S_4")
    }
    last["left_out"] = read_attributes(path).get("left_out", "")
    try:
        fit = fit_onset(observables["phi"], observables["p"])
    except ValueError:  # the run ends below jamming
        return {"out": str(path), **last, "phi_J": None}
    return {"out": str(path), **last, "phi_J": fit.phi_J, "phi_J_error": fit.phi_J_error}
