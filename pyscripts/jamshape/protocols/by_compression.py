"""Packings from a compression at one rate: the protocol marschall-2018 (Marschall & Teitel 2018).

Sec. II has the compression, and Sec. III C what follows: "we start with a configuration with U > U0 obtained from
our continuous compression runs at a fixed rate, and energy minimize it". They do not specify which one. Here it is
the first frame that stays jammed when minimised, which is nearest to the onset; frames before it flow.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from jamshape.files.h5md import count_frames, read_observables, read_packing
from jamshape.files.journal import remove_run
from jamshape.flow import recording
from jamshape.flow.compression import Compression
from jamshape.flow.motion import Row
from jamshape.flow.recording import Recording
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape
from jamshape.minima import Minimum, Stop, minimise
from jamshape.minima.target import require_reachable
from jamshape.packing import Packing, State
from jamshape.protocols.making import Progress
from jamshape.protocols.recipe import Compressed, Recipe
from jamshape.shapes.shape import Interaction

# Rows and frames of a compression; frames are about 2e-3 of phi apart at jamming.
_ROWS, _FRAMES = 600, 300

# Residual to which a frame is minimised to decide whether it is jammed.
_GOOD = 1e-4

# Settings of the search alone; a compression, whose file holds its final packing fraction, serves any search.
_OF_SEARCH = ("phi_start", "search", "start", "protocol")


class Chosen(NamedTuple):
    """Frame from which the search for the energy starts."""

    packing: Packing
    u: float
    pressure: float
    minimised_u: float
    """Energy density in force balance."""


class ByCompression:
    """A compression at one rate and its file beside the target packing, or a given file.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Path of the packing.
    """

    minimum: Minimum | None = None

    def __init__(self, recipe: Recipe, out: Path) -> None:
        assert isinstance(recipe.way, Compressed)
        self.recipe, self.way = recipe, recipe.way
        self.run_file = self.way.source or out.with_name(out.name + ".run.h5")
        self.evaluations = 0  # of forces, for the choice of a frame

    @property
    def is_own(self) -> bool:
        """Whether the compression is made here."""
        return self.way.source is None

    def forget(self) -> None:
        """Remove remains of an earlier call, but not a given file."""
        if self.is_own:
            remove_run(self.run_file)
            self._recording().restarts.forget()

    def require_own(self) -> None:
        """Raise if the compression belongs to another recipe.

        Raises
        ------
        ValueError
        """
        if self.is_own and self.run_file.exists():
            recording.require_same(self._recording(), self._flow(), self.recipe.dimension)
            self.recipe.require_particles(self.run_file)

    def steps(self) -> Iterator[Progress]:
        """Compress, resuming an earlier call, and choose the frame for the search."""
        if self.is_own:
            yield from self._compress()
        yield from self._choose()

    def landscape(self) -> Landscape:
        """Landscape of the packing."""
        return Landscape(self.chosen.packing)

    def state(self) -> State:
        """Return the initial state of the search for the energy."""
        return State.of(self.chosen.packing)

    def measured(self) -> dict[str, Any]:
        """Return the history: end of the compression, chosen state, and the cost of each."""
        packing, u, pressure, minimised = self.chosen
        found: dict[str, Any] = {"start_file": self.run_file.name, "start_step": packing.step}
        found |= {"start_phi": packing.phi, "start_u": u, "start_pressure": pressure}
        found |= {"start_u_minimised": minimised, "start_evaluations": self.evaluations}
        rows = read_observables(self.run_file)
        for name in ("phi", "u", "pressure", "evaluations"):
            if len(rows.get(name, ())):
                found[f"compression_{name}"] = float(rows[name][-1])
        return found

    def done(self) -> None:
        """Keep the run, which serves searches for other energies."""

    def _flow(self) -> Compression:
        """Return the settings of the compression: two bonds side to side, and an integrator with error control."""
        flow = Compression(
            kappa=self.way.kappa, phi_end=self.way.phi_end, sides=2, integrator="rkc2"
        )
        return flow.in_steps(self.recipe.phi_start, _ROWS, self.recipe.dimension)

    def _recording(self) -> Recording:
        told = self.recipe.before_target()
        of_run = {name: value for name, value in told.items() if name not in _OF_SEARCH}
        of_run["of_packing"] = True
        return Recording(self.run_file, _ROWS, _FRAMES, of_run)

    def _compress(self) -> Iterator[Progress]:
        if recording.is_finished(self.run_file):
            recording.tidy(self.run_file)
            return
        assert self.recipe.target is not None
        with Session() as session:
            if self.run_file.exists():
                run, to = recording.resume(session, self.run_file)
            else:
                start, to = self.recipe.start(), self._recording()
                require_reachable(Landscape(start), self.recipe.target)
                run = recording.begin(session, self._flow(), start, to)
            for row in recording.record(run, to):
                yield self._progress(row)

    def _progress(self, row: Row) -> Progress:
        found, end = row.observables, self.way.phi_end
        text = f"pressure {found['pressure']:.2e}, to phi {end:g} at rate {self.way.kappa:.1e}"
        begun = self.recipe.phi_start
        part = min(1.0, max(0.0, (found["phi"] - begun) / (end - begun)))
        return Progress("compression", "compression", found["phi"], found["u"], text, part)

    def _choose(self) -> Iterator[Progress]:
        """Bisect the frames between one that flows and one that is jammed, down to neighbours."""
        assert self.recipe.target is not None
        u0, first, last = self.recipe.target.u0, -1, count_frames(self.run_file) - 1
        chosen = self._minimised(last)
        if chosen.minimised_u <= u0:
            msg = (
                f"{self.run_file}: its last frame, at phi = {chosen.packing.phi:.6g}, has u = {chosen.minimised_u:.2g}"
                f" after minimisation, expected more than u0 = {u0:g};"
                " compress further, beyond jamming (phi_end)"
            )
            raise ValueError(msg)
        while last - first > 1:
            middle = (first + last) // 2
            found = self._minimised(middle)
            if found.minimised_u > u0:
                last, chosen = middle, found
            else:
                first = middle
            text = f"frame {last} is jammed, frame {first} is not, u {found.minimised_u:.1e}"
            phi = chosen.packing.phi
            yield Progress("choice", "choice of a jammed frame", phi, chosen.minimised_u, text)
        self.chosen = chosen

    def _minimised(self, frame: int) -> Chosen:
        """Minimise a frame until forces balance, or until it is unjammed."""
        assert self.recipe.target is not None
        # Minima exist with two bonds side to side, whatever the law of the dynamics.
        packing = read_packing(self.run_file, frame).with_(law=Interaction())
        landscape, state = Landscape(packing), State.of(packing)
        before = landscape.evaluate(state)
        stop = Stop(_GOOD, lowest=self.recipe.target.u0)
        minimised_u = minimise(landscape, state, "auto", stop).energy_density
        self.evaluations += landscape.evaluations
        u, slope = before.energy / state.volume, before.strain_gradient
        return Chosen(packing, u, -slope / (state.dimension * state.volume), minimised_u)
