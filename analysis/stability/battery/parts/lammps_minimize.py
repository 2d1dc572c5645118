"""Cases of the stability battery: LAMMPS's minimize with our pair styles, and compressions from Python."""

from __future__ import annotations

from functools import partial

import numpy as np

from battery.case import Case
from battery.scenes.elongated import jammed
from battery.scenes.making import Scene, scaled
from battery.session import Setting, frame, loaded, measured, set_up
from battery.shapes.table import SHAPES
from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session

PROTOCOL = "compression from Python"


def minimised(scene: Scene, sides: int, style: str, line: str = "quadratic") -> float:
    """Energy after 50 iterations over that before."""
    packing = scene()
    search = f"min_style {style}\nmin_modify dmax 0.1 line {line}"
    with loaded(packing, f"{set_up(packing, Setting(sides))}\n{search}") as session:
        session.commands("run 0")
        before = measured(session, "energy")
        session.commands("minimize 0 1e-300 50 500\nrun 0")
        after, at = measured(session, "energy"), frame(session, packing)
    return after / before if at.is_finite else np.inf


def compression_in_units(length: float, k_e: float) -> float:
    """`CompressionRun` in other units: phi it stops at, and pressure, against that in units of 2R."""
    found = []
    for unit, energy in ((1.0, 1.0), (length, k_e)):
        t0 = unit**4 / energy  # k_d = 1 in all
        packing = scaled(jammed(0.0, 16, 0.8), unit)
        with Session() as session:
            settings = Compression(kappa=1e-3 / t0, phi_end=0.9, dt=0.1 * t0, k_e=energy)
            run = CompressionRun(session, settings, packing)
            run.advance(run.last_step)
            at = run.measure()
            found.append((at["phi"], at["pressure"] * unit**2 / energy))
    (phi, p), (phi_there, p_there) = found
    return max(abs(phi_there / phi - 1), abs(p_there / p - 1))


def cases() -> list[Case]:
    """All of them."""
    found = []
    for shape in SHAPES:
        for name, scene in shape.minimized.items():
            for style in ("cg", "sd"):
                for line in ("quadratic", "backtrack"):
                    run = partial(minimised, scene, shape.laws[-1].sides, style, line)
                    # The deep one has been minimised before; all others must gain.
                    limit = 1.0 if "third" in name else 0.99
                    part, label = f"LAMMPS minimize, {shape.name}", f"{name}, {style}, line {line}"
                    found.append(Case(part, label, "energy over that before", limit, run))
    for length, k_e in ((1e-3, 1.0), (1e3, 1.0), (1.0, 1e-6), (1.0, 1e6)):
        label = f"length {length:g}, k_e {k_e:g}"
        in_units = partial(compression_in_units, length, k_e)
        found.append(Case(PROTOCOL, label, "change of scaled p and of phi", 1e-8, in_units))
    return found
