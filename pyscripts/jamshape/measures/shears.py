"""Stored shears: stress against strain and steady states, grouped into ensembles."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import read_observables
from jamshape.measures.steady import SteadyState, steady_state


class Sheared(NamedTuple):
    """Common settings of shears that differ only in their seed."""

    system: System
    n: int
    size_ratio: float
    """1 if not stored."""
    phi: float
    gdot: float
    flow: str
    hold_pressure: float
    """0 if the volume is held; if not, `phi` is that of the start."""

    def report(self) -> dict[str, Any]:
        """Return a description for JSON."""
        own = {name: getattr(self, name) for name in ("n", "size_ratio", "phi", "gdot", "flow")}
        return self.system.report() | own


class ShearOf(NamedTuple):
    """A shear and its steady state, or one sentence on why there is none."""

    path: Path
    ensemble: Sheared
    seed: int
    strain: FloatArray
    observables: dict[str, FloatArray]
    steady: SteadyState | None
    problem: str = ""


def strain_of(observables: dict[str, FloatArray], flow: str) -> FloatArray:
    """(T,) strains of a run since its start."""
    return np.asarray(observables["pure_strain" if flow == "pure" else "shear_strain"], np.float64)


def read_shear(path: Path, after: float | None = None) -> ShearOf:
    """Read a shear and average over its steady state, from a given strain or as `steady_state` chooses.

    Raises
    ------
    ValueError
        If the file holds no shear.
    """
    file = PackingFile.read(path)
    known = file.attributes
    if "gdot" not in known:
        msg = f"{path}: holds no shear at a rate, expected a run of shear.py"
        raise ValueError(msg)
    found = {name: np.asarray(x, np.float64) for name, x in read_observables(path).items()}
    phi, flow = round(float(found["phi"][0]), 9), str(known["flow"])
    ensemble = Sheared(
        file.system(), int(known["n"]), float(known.get("size_ratio", 1.0)), phi,
        float(known["gdot"]), flow, float(known.get("hold_pressure", 0.0)),
    )  # fmt: skip
    strain = strain_of(found, flow)
    run = ShearOf(path, ensemble, int(known.get("seed", 0)), strain, found, None)
    try:
        return run._replace(steady=steady_state(found, strain, after))
    except ValueError as error:  # too short
        return run._replace(problem=f"{path}: {error}")


def shear_report(path: Path, after: float | None = None) -> dict[str, Any]:
    """Summarise a shear: its end, and averages over its steady state."""
    run = read_shear(path, after)
    found: dict[str, Any] = {"out": str(path), "phi": run.ensemble.phi, "gdot": run.ensemble.gdot}
    found["strain"] = float(run.strain[-1])
    steady = run.steady.report() if run.steady else {"steady": run.problem}
    return found | steady
