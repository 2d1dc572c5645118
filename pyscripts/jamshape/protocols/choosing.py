"""The frame of a compression from which the search for an energy starts (Marschall & Teitel 2018, Sec. III C).

"We start with a configuration with U > U0 obtained from our continuous compression runs at a fixed rate, and energy
minimize it". They do not specify which one. Here it is the first frame that stays jammed when minimised, which is
nearest to the onset; frames before it flow.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jamshape.files.checkpoint import Checkpoint
from jamshape.files.h5md import count_frames, read_packing
from jamshape.landscape import Landscape
from jamshape.minima import Stop, minimise
from jamshape.packing import Packing, State
from jamshape.protocols.stages import Making
from jamshape.recording.driver import Told

# Residual to which a frame is minimised to decide whether it is jammed.
_GOOD = 1e-4


def frame_of(file: Path, frame: int) -> Packing:
    """Read a frame under the law of minima: two bonds side to side, whatever the dynamics had."""
    found = read_packing(file, frame)
    return found.with_(law=found.law.but(sides=2))


class Choosing:
    """Bisection of the frames between one that flows and one that is jammed, down to neighbours.

    Parameters
    ----------
    making : Making
    checkpoint : Checkpoint, optional
    file : path
        File of the compression.
    """

    def __init__(self, making: Making, checkpoint: Checkpoint | None, file: Path) -> None:
        self._making, self._file = making, file
        at = checkpoint or {"first": -1, "last": count_frames(file), "minimised_u": 0.0}
        self._first, self._last = int(at["first"]), int(at["last"])
        self._u = float(at["minimised_u"])

    @property
    def done(self) -> bool:
        """Whether the two frames are neighbours."""
        return self._last - self._first <= 1

    def advance(self) -> Told:
        """Minimise a frame: the last one at first, then that between the two."""
        n, target = count_frames(self._file), self._making.target
        middle = n - 1 if self._last == n else (self._first + self._last) // 2
        packing = frame_of(self._file, middle)
        found = self._minimised_u(packing)
        if found > target.u0:
            self._last, self._u = middle, found
        elif middle == n - 1:
            msg = (
                f"{self._file}: its last frame, at phi = {packing.phi:.6g}, has u = {found:.2g}"
                f" after minimisation, expected more than u0 = {target.u0:g};"
                " compress further, beyond jamming (phi_end)"
            )
            raise ValueError(msg)
        else:
            self._first = middle
        text = f"frame {self._last} is jammed, frame {self._first} is not, u {found:.1e}"
        return self._making.told("choice of a jammed frame", text, State.of(packing))

    def _minimised_u(self, packing: Packing) -> float:
        """Minimise until forces balance, or until the frame is unjammed; return u."""
        landscape = Landscape(packing)
        stop = Stop(_GOOD, lowest=self._making.target.u0)
        u = minimise(landscape, State.of(packing), "auto", stop).energy_density
        self._making.landscape.evaluations += landscape.evaluations
        return u

    def checkpoint(self) -> Checkpoint:
        """Return the two frames."""
        return {"first": self._first, "last": self._last, "minimised_u": self._u}

    def end(self) -> None:
        """Hand on the jammed frame and its history."""
        making, packing = self._making, frame_of(self._file, self._last)
        evaluations, state = making.landscape.evaluations, State.of(packing)
        at = Landscape(packing).evaluate(state)
        pressure = -at.strain_gradient / (state.dimension * state.volume)
        found: dict[str, Any] = {"start_file": self._file.name, "start_step": packing.step}
        found |= {"start_phi": packing.phi, "start_u": at.energy / state.volume}
        found |= {"start_pressure": pressure, "start_u_minimised": self._u}
        making.attributes |= found | {"start_evaluations": evaluations}
        making.landscape, making.state, making.frame = Landscape(packing), state, self._last
