"""The whole path of one packing of superellipsoids: Yuan et al., Soft Matter (2019), Sec. 2.2.

Dilute random start; protocol 2: compressed to an intermediate packing fraction and thermalised as hard particles;
compressed quasistatically to the first jammed packing (protocol 1); led to a chosen energy density, if
asked for; measured and stored. Between its steps everything is in a file beside the result, so that a
path that was cut off goes on where it was.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.contacts import find_contacts
from jamshape.files.h5md import (
    RunWriter,
    read_attributes,
    read_packing,
    require_attributes,
    write_packing,
)
from jamshape.landscape import Landscape, State
from jamshape.measures.order3d import cubatic_order, directors, nematic_order
from jamshape.minima.minimise import Minimum, residual_of, rounding_floor
from jamshape.minima.target import Search, Target, direct
from jamshape.packing import Box, Packing, body_axes
from jamshape.protocols.jammed import Progress, energy_onset, summary_of, thinned
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun, compress
from jamshape.protocols.thermal import Thermal, equilibrate, without_overlaps
from jamshape.shapes.superellipsoid_size import (
    asphericity,
    axes_from,
    reduced_aspect_ratio,
    volume,
)

_PROTOCOLS = (1, 2)
_STORE_SECONDS = 20.0

_SUMMARY = (
    *(
        "p",
        "w1",
        "w2",
        "n",
        "protocol",
        "seed",
        "outcome",
        "phi",
        "phi_J",
        "energy_per_particle",
        "u",
    ),
    *("pressure", "z", "n_contacts", "n_rattlers", "z_iso", "S2", "C4", "asphericity", "beta"),
    *("residual_force", "residual_torque", "evaluations", "wall_seconds"),
)


@dataclass(frozen=True)
class Sample:
    """What a packing is made of.

    Parameters
    ----------
    n, seed
        Equal particles, and the seed of all that is random.
    p, w1, w2
        Exponent, and ratios a/b <= 1 and c/b >= 1 of the semi-axes a <= b <= c; a is 1.
    protocol
        1, or 2 with thermalisation.
    phi_start
        Packing fraction of the dilute start.
    phi_thermal, n_sweeps
        phi_i and N_s of protocol 2.
    quasistatic
        How to compress.
    target
        Energy density to lead the first jammed packing to, by Newton's method on coordinates and box; None
        for the bisection of protocol 1.

    Raises
    ------
    ValueError
        If a number is out of its range.
    """

    n: int = 400
    p: float = 1.0
    w1: float = 1.0
    w2: float = 1.0
    protocol: int = 1
    seed: int = 1
    phi_start: float = 0.1
    phi_thermal: float = 0.55
    n_sweeps: int = 100_000
    quasistatic: Quasistatic = field(default_factory=Quasistatic)
    target: Target | None = None

    def __post_init__(self) -> None:
        if self.n < 1:
            msg = f"n is {self.n}, expected at least one particle"
            raise ValueError(msg)
        if self.protocol not in _PROTOCOLS:
            msg = f"protocol is {self.protocol}, expected 1 or 2"
            raise ValueError(msg)
        if not (0 < self.phi_start < 1 and 0 < self.phi_thermal < 1 and self.n_sweeps >= 0):
            msg = "a packing fraction or the number of sweeps is out of range, expected 0 < phi < 1"
            raise ValueError(msg)

    @property
    def compression(self) -> Quasistatic:
        """How to compress: what is to be led elsewhere need not be close to the tolerance."""
        return replace(self.quasistatic, closeness=math.inf) if self.target else self.quasistatic

    @property
    def semi_axes(self) -> FloatArray:
        """(3,) a <= b <= c in units of a."""
        return axes_from(self.w1, self.w2)

    def start(self) -> Packing:
        """Place particles at random, with random orientations; they may overlap a little."""
        rng = np.random.default_rng(self.seed)
        edge = (self.n * float(volume(self.semi_axes, self.p)) / self.phi_start) ** (1 / 3)
        quaternion = rng.normal(size=(self.n, 4))
        return Packing(
            position=rng.uniform(0, edge, (self.n, 3)),
            orientation=quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True),
            diameters=np.tile(2 * self.semi_axes, (self.n, 1)),
            species=np.ones(self.n, np.int64),
            id=np.arange(1, self.n + 1),
            box=Box(np.zeros(3), np.full(3, edge)),
            shape_style="superellipsoid",
            exponent=np.full(self.n, float(self.p)),
        )

    def attributes(self) -> dict[str, Any]:
        """Return what identifies it, to be stored."""
        numbers = {k: v for k, v in vars(self).items() if k not in {"quasistatic", "target"}}
        if self.protocol == 1:
            numbers = {k: v for k, v in numbers.items() if k not in {"phi_thermal", "n_sweeps"}}
        numbers |= {f"quasistatic_{k}": v for k, v in vars(self.compression).items()}
        numbers["u0"] = self.target.u0 if self.target else math.nan
        return {k: v for k, v in numbers.items() if not (isinstance(v, float) and math.isnan(v))}


def require_same(out: Path, sample: Sample) -> None:
    """Refuse a finished packing that is another one than asked for.

    Raises
    ------
    ValueError
    """
    require_attributes(out, sample.attributes())


def make(sample: Sample, out: Path, *, again: bool = False) -> Iterator[Progress]:
    """Make a packing and write it to `out`, going on with what an earlier call has left.

    Parameters
    ----------
    sample : Sample
    out : Path
        Replaced when the packing is found.
    again : bool
        Begin anew, whatever an earlier call has left.

    Yields
    ------
    Progress
        After every minimisation and every block of sweeps.

    Raises
    ------
    TargetError
        As `target.direct`.
    ValueError
        If another sample was being made there, or the start is jammed.
    """
    began = time.perf_counter()
    if again:
        _path_file(out).unlink(missing_ok=True)
    path = _Path(sample, out)
    yield from path.steps()
    assert path.minimum is not None
    attributes = sample.attributes() | {
        "wall_seconds": path.seconds_before + time.perf_counter() - began,
        "evaluations": path.landscape.evaluations,
        "acceptance": path.thermal.acceptance if path.thermal else math.nan,
    }
    write_minimum(out, path.landscape, path.minimum, attributes)
    path.files_done()


def _path_file(out: Path) -> Path:
    return out.with_name(out.name + ".path.h5")


class _Path:
    """Where the making of a packing is, in memory and in a file."""

    def __init__(self, sample: Sample, out: Path) -> None:
        self.sample, self.file = sample, _path_file(out)
        start = sample.start()
        self.landscape = Landscape(start)
        self.compression = QuasistaticRun.of(self.landscape, State.of(start), sample.compression)
        self.thermal: Thermal | None = None
        self.is_thermalised = sample.protocol == 1
        self.minimum: Minimum | None = None
        self.seconds_before = 0.0
        self._stored = self._began = time.perf_counter()
        if self.file.exists():
            self._read()

    def steps(self) -> Iterator[Progress]:
        """Go on to the end."""
        if not self.is_thermalised:
            if self.thermal is None:
                yield from self._compress(self.sample.phi_thermal)
                assert self.compression.loose is not None
                loose = self.compression.loose.packing(self.landscape.particles)
                self.thermal = Thermal(without_overlaps(loose))
            yield from self._thermalise()
        yield from self._compress(math.inf)
        self.minimum = self.compression.minimum
        if self.sample.target:
            yield from self._lead(self.sample.target)

    def files_done(self) -> None:
        """Remove what was there to go on from."""
        self.file.unlink(missing_ok=True)

    def _compress(self, phi: float) -> Iterator[Progress]:
        while self.compression.minimum is None and self.compression.phi < phi:
            step = next(compress(self.landscape, self.compression, self.sample.compression))
            history = step.history
            self._store()
            yield Progress(
                "compression", step.phi, history.energy_density[-1], history.residual[-1]
            )

    def _thermalise(self) -> Iterator[Progress]:
        assert self.thermal is not None
        for at in equilibrate(self.thermal, self.sample.n_sweeps, self.sample.seed):
            self._store()
            yield Progress(f"sweep {at.n_done}", at.packing.phi, 0.0, at.acceptance)
        start = State.of(self.thermal.packing)
        self.compression = QuasistaticRun.of(self.landscape, start, self.sample.compression)
        self.is_thermalised = True

    def _lead(self, target: Target) -> Iterator[Progress]:
        assert self.minimum is not None
        search = Search(self.minimum.state, target.step)
        for at in direct(self.landscape, search, target):
            history = at.history
            phi = self.landscape.particles.measures.sum() / at.state.volume
            yield Progress("search", phi, history.energy_density[-1], history.residual[-1])
        self.minimum = search.minimum

    def _store(self) -> None:
        now = time.perf_counter()
        if now - self._stored < _STORE_SECONDS or self.compression.minimum is not None:
            return
        self._stored = now
        compression, like = self.compression, self.landscape.particles
        states = [compression.loose or compression.state, compression.state]
        frames = [state.packing(like) for state in states]
        if self.thermal:
            frames.append(self.thermal.packing)
        attributes = self.sample.attributes() | {
            "phi": compression.phi,
            "step": compression.step,
            "loose_phi": compression.loose_phi,
            "is_thermalised": self.is_thermalised,
            "n_sweeps_done": self.thermal.n_done if self.thermal else -1,
            "move_size": self.thermal.size if self.thermal else 0.0,
            "seconds_before": self.seconds_before + now - self._began,
        }
        temporary = self.file.with_name(self.file.name + ".new")
        writer = RunWriter.create(temporary, frames[0].with_(step=0), attributes)
        for k, frame in enumerate(frames[1:], 1):
            writer.append(frame.with_(step=k))
        temporary.replace(self.file)

    def _read(self) -> None:
        require_attributes(self.file, self.sample.attributes(), "the making of a packing")
        stored = read_attributes(self.file)
        loose_phi = float(stored["loose_phi"])
        self.compression = QuasistaticRun(
            state=State.of(read_packing(self.file, 1)),
            phi=float(stored["phi"]),
            step=float(stored["step"]),
            loose=None if math.isnan(loose_phi) else State.of(read_packing(self.file, 0)),
            loose_phi=loose_phi,
        )
        self.is_thermalised = bool(stored["is_thermalised"])
        self.seconds_before = float(stored["seconds_before"])
        if stored["n_sweeps_done"] >= 0:
            packing, n_done = read_packing(self.file, 2), int(stored["n_sweeps_done"])
            self.thermal = Thermal(packing, n_done, float(stored["move_size"]))


def write_minimum(
    path: Path, landscape: Landscape, minimum: Minimum, attributes: dict[str, Any]
) -> None:
    """Write a packing with everything that was measured on it."""
    packing = minimum.state.packing(landscape.particles)
    measured, observables = measure(landscape, minimum)
    write_packing(path, packing, attributes | measured, observables)
    RunWriter.open(path).append_report(*thinned(minimum.history))


def measure(
    landscape: Landscape, minimum: Minimum
) -> tuple[dict[str, float | str], dict[str, FloatArray]]:
    """Measure a minimum: attributes and observables of its file."""
    packing, evaluation = minimum.state.packing(landscape.particles), minimum.evaluation
    rattlers = landscape.curvature(minimum.state).rattlers
    network = find_contacts(packing, landscape.k_e)
    held = ~rattlers[network.pairs].any(axis=1)
    n_backbone, n_contacts = int((~rattlers).sum()), int(held.sum())
    residual = residual_of(landscape, evaluation)
    u, D = minimum.energy_density, packing.dimension
    pressure = -evaluation.strain_gradient / (D * minimum.state.volume)
    attributes: dict[str, float | str] = {
        "outcome": minimum.outcome.value,
        "phi": packing.phi,
        "phi_J": energy_onset(packing.phi, u, pressure),
        "u": u,
        "energy_per_particle": evaluation.energy / packing.n,
        "pressure": pressure,
        "residual_force": residual.force,
        "residual_torque": residual.torque,
        "rounding_floor": rounding_floor(evaluation, landscape),
        "z": 2 * n_contacts / max(n_backbone, 1),
        "n_contacts": n_contacts,
        "n_rattlers": packing.n - n_backbone,
        **shape_measures(packing),
        **order(packing),
    }
    return attributes, {"rattler_ids": packing.id[rattlers].astype(np.float64)}


def shape_measures(packing: Packing) -> dict[str, float]:
    """Asphericity, beta and z_iso of the first particle's shape (Yuan et al. 2019, Eq. 2)."""
    axes, p = packing.diameters[0] / 2, packing.exponent[0]
    d_f = 3 if packing.is_round[0] else 5 if packing.symmetry_axis[0] >= 0 else 6
    return {
        "asphericity": float(asphericity(axes, p)),
        "beta": float(reduced_aspect_ratio(axes)),
        "z_iso": 2.0 * d_f,
    }


def order(packing: Packing) -> dict[str, float]:
    """S_2 and C_4 of all particles (Yuan et al. 2019, Eqs. 6 and 7)."""
    axes = body_axes(packing.quaternions)
    director = directors(axes, packing.diameters[0] / 2)
    return {
        "S2": float(nematic_order(director).magnitude),
        "C4": float(cubatic_order(axes).magnitude),
    }


def summary(out: Path) -> dict[str, Any]:
    """Summarise a finished packing."""
    return summary_of(out, _SUMMARY)
