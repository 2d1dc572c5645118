"""Packings from quasistatic steps, with optional Monte Carlo (Yuan et al. 2019, Sec. 2.2)."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from jamshape.files.disk import remove_leftovers
from jamshape.files.h5md import read_attributes, read_packing, require_attributes
from jamshape.landscape import Landscape
from jamshape.minima import Minimum
from jamshape.minima.target import require_reachable
from jamshape.packing import State
from jamshape.protocols.making import Progress, write_states
from jamshape.protocols.quasistatic import QuasistaticRun, compress
from jamshape.protocols.recipe import Recipe, Steps
from jamshape.protocols.thermal import Thermal, equilibrate, without_overlaps

_STORE_SECONDS = 20.0


class BySteps:
    """State of the quasistatic compression, in memory and in a file beside the packing.

    Parameters
    ----------
    recipe : Recipe
    out : Path
        Path of the packing.
    """

    def __init__(self, recipe: Recipe, out: Path) -> None:
        assert isinstance(recipe.way, Steps)
        self.recipe, self.way = recipe, recipe.way
        self.file = out.with_name(out.name + ".path.h5")
        self.protocol = self.way.compression(recipe.target)
        self.minimum: Minimum | None = None
        self.seconds_before = 0.0
        self.thermal: Thermal | None = None
        self.is_thermalised = self.way.thermal is None
        self._stored = self._began = time.perf_counter()

    def forget(self) -> None:
        """Remove remains of an earlier call."""
        self.file.unlink(missing_ok=True)

    def require_own(self) -> None:
        """Raise if the file belongs to another recipe.

        Raises
        ------
        ValueError
        """
        remove_leftovers(self.file)  # a resumed run may end without writing the file again
        if self.file.exists():
            require_attributes(self.file, self.recipe.attributes(), "the making of a packing")

    def steps(self) -> Iterator[Progress]:
        """Continue to the first jammed packing."""
        start = self.recipe.start()
        self._landscape = Landscape(start)
        self.compression = QuasistaticRun.of(self._landscape, State.of(start), self.protocol)
        if self.file.exists():
            self._read()
        elif self.recipe.target:
            require_reachable(self._landscape, self.recipe.target)
        if self.way.thermal and not self.is_thermalised:
            if self.thermal is None:
                yield from self._compress(self.way.thermal.phi)
                assert self.compression.loose is not None
                loose = self.compression.loose.packing(self._landscape.particles)
                self.thermal = Thermal(without_overlaps(loose))
            yield from self._thermalise(self.thermal, self.way.thermal.n_sweeps)
        yield from self._compress(math.inf)
        self.minimum = self.compression.minimum

    def landscape(self) -> Landscape:
        """Landscape of the packing."""
        return self._landscape

    def state(self) -> State:
        """Return the initial state of the search for an energy: the first jammed packing."""
        assert self.minimum is not None
        return self.minimum.state

    def measured(self) -> dict[str, Any]:
        """Return results specific to this protocol."""
        acceptance = self.thermal.acceptance if self.thermal else math.nan
        return {"acceptance": acceptance, "seconds_before": self.seconds_before}

    def done(self) -> None:
        """Remove the files for resuming."""
        self.forget()

    def _compress(self, phi: float) -> Iterator[Progress]:
        while self.compression.minimum is None and self.compression.phi < phi:
            step = next(compress(self._landscape, self.compression, self.protocol))
            self._store()
            yield self._progress(step, phi)

    def _progress(self, step: QuasistaticRun, phi: float) -> Progress:
        """Return the energy and the step, with their targets."""
        u = step.history.energy_density[-1]
        energy = u * step.state.volume / self.recipe.n
        text = f"U/N {energy:.1e} of {self.protocol.energy:.0e}, next step {step.step:.1e}"
        aim = f"to phi = {phi:g}" if math.isfinite(phi) else "to jamming"
        return Progress("compression", f"compression {aim}", step.phi, u, text)

    def _thermalise(self, thermal: Thermal, n_sweeps: int) -> Iterator[Progress]:
        for at in equilibrate(thermal, n_sweeps, self.recipe.seed):
            self._store()
            text = f"sweep {at.n_done} of {n_sweeps}, acceptance {at.acceptance:.2f}"
            part = at.n_done / n_sweeps
            yield Progress("Monte Carlo", "Monte Carlo", at.packing.phi, 0.0, text, part)
        start = State.of(thermal.packing)
        self.compression = QuasistaticRun.of(self._landscape, start, self.protocol)
        self.is_thermalised = True

    def _store(self) -> None:
        now = time.perf_counter()
        if now - self._stored < _STORE_SECONDS or self.compression.minimum is not None:
            return
        self._stored = now
        compression, like = self.compression, self._landscape.particles
        states = [compression.loose or compression.state, compression.state]
        if self.thermal:
            states.append(State.of(self.thermal.packing))
        attributes = self.recipe.attributes() | {
            "phi": compression.phi,
            "phi_step": compression.step,
            "parts": compression.parts,
            "loose_phi": compression.loose_phi,
            "jammed_phi": compression.jammed_phi,
            "openings": compression.openings,
            "halves": compression.halves,
            "is_thermalised": self.is_thermalised,
            "n_sweeps_done": self.thermal.n_done if self.thermal else -1,
            "move_size": self.thermal.size if self.thermal else 0.0,
            "seconds_before": self.seconds_before + now - self._began,
            "evaluations": self._landscape.evaluations,
        }
        write_states(self.file, states, like, attributes)

    def _read(self) -> None:
        stored = read_attributes(self.file)
        loose_phi = float(stored["loose_phi"])
        self.compression = QuasistaticRun(
            state=State.of(read_packing(self.file, 1)),
            phi=float(stored["phi"]),
            step=float(stored["phi_step"]),
            loose=None if math.isnan(loose_phi) else State.of(read_packing(self.file, 0)),
            loose_phi=loose_phi,
            jammed_phi=float(stored.get("jammed_phi", math.nan)),
            openings=int(stored.get("openings", 0)),
            halves=bool(stored.get("halves", False)),
            parts=int(stored.get("parts", 0)),
        )
        self.is_thermalised = bool(stored["is_thermalised"])
        self.seconds_before = float(stored["seconds_before"])
        self._landscape.evaluations = int(stored.get("evaluations", 0))
        if stored["n_sweeps_done"] >= 0:
            packing, n_done = read_packing(self.file, 2), int(stored["n_sweeps_done"])
            self.thermal = Thermal(packing, n_done, float(stored["move_size"]))
