"""Cases of the stability battery: quasistatic compressions."""

from __future__ import annotations

from functools import cache, partial
from typing import Any

import numpy as np

from battery.case import Case
from battery.parts.implicit import UNITS
from battery.scenes.elongated import deep
from battery.scenes.making import Scene, scaled
from battery.scenes.superellipsoids import loose
from battery.shapes.table import SHAPES
from jamshape.landscape import Landscape, State
from jamshape.packing import Packing
from jamshape.protocols.quasistatic import Quasistatic, QuasistaticRun
from jamshape.protocols.quasistatic import compress as compress_quasistatically

PART = "quasistatic compression"


def _first_jammed(packing: Packing, protocol: Quasistatic, k_e: float = 1.0) -> tuple[float, ...]:
    """Give its phi, U/N over the energy asked for, the residual, and the densest loose phi."""
    landscape = Landscape(packing, k_e)
    compression = QuasistaticRun.of(landscape, State.of(packing), protocol)
    for _ in compress_quasistatically(landscape, compression, protocol):
        pass
    assert compression.minimum is not None
    per_particle = compression.minimum.evaluation.energy / packing.n / protocol.energy
    residual = compression.minimum.residual.largest
    return compression.phi, per_particle, residual, compression.loose_phi


def quasistatic_end(packing: Scene, step: float) -> float:
    """Residual of the first jammed packing over the tolerance; infinite if it is not one."""
    protocol = Quasistatic(step=step, energy=1e-8)
    phi, per_particle, residual, loose_phi = _first_jammed(packing(), protocol)
    # Without an energy close to that asked for, it jumps there by a rearrangement.
    is_first = 1 < per_particle <= protocol.closeness or phi - loose_phi < 1e-8
    return residual / protocol.tolerance if is_first and loose_phi < phi else np.inf


def _jammed_in(length: float, k_e: float) -> float:
    packing = scaled(loose(2, 1.0, 2.0), length)
    return _first_jammed(packing, Quasistatic(step=5e-3, energy=1e-8 * k_e), k_e)[0]


@cache
def _jammed_here() -> float:
    return _jammed_in(1.0, 1.0)


def quasistatic_in_units(length: float, k_e: float) -> float:
    """Change of phi_J by units that are powers of two."""
    return abs(_jammed_in(length, k_e) / _jammed_here() - 1)


def _jammed_start() -> str:
    _first_jammed(deep(2, 0.0), Quasistatic())
    return "no sentence"


def _asked(changes: dict[str, Any]) -> str:
    Quasistatic(**changes)
    return "no sentence"


def cases() -> list[Case]:
    """All of them."""
    found, what = [], "residual of the first jammed packing, over the tolerance"
    for shape in SHAPES:
        own = shape.compressed
        for name, scene in own.quasistatic.items():
            run: Any = partial(quasistatic_end, scene, 2e-2)
            found.append(Case(PART, name, what, 1.0, run, name not in own.quick))
    for step in (1e-4, 0.1, 1.0, 10.0):
        run = partial(quasistatic_end, partial(loose, 2, 1.0, 2.0), step)
        found.append(Case(PART, f"steps of {step:g}", what, 1.0, run, heavy=step == 1e-4))
    for length, k_e in UNITS:
        run = partial(quasistatic_in_units, length, k_e)
        label = f"length {length:.3g}, k_e {k_e:.3g}"
        found.append(Case(PART, label, "change of phi_J", 1e-12, run))
    words = "start at phi = .* is jammed .* start at a smaller phi"
    found.append(Case(PART, "overlaps of a third", "sentence", words, _jammed_start))
    for name, value in (
        ("step", 0.0), ("step", np.inf), ("energy", -1.0), ("tolerance", np.nan), ("closeness", 1.0),
    ):  # fmt: skip
        run = partial(_asked, {name: value})
        found.append(Case(PART, f"{name} {value:g}", "sentence", rf"{name} is .*expected", run))
    return found
