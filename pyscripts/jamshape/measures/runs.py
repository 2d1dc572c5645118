"""Stored compressions: p(phi) with the onset of jamming, grouped into ensembles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jamshape.arrays import FloatArray
from jamshape.files.ensembles import PackingFile, System
from jamshape.files.h5md import read_attributes, read_observables
from jamshape.measures.jamming import Jamming
from jamshape.measures.onset import OnsetFit, fit_onset
from jamshape.shapes.shape import Interaction

# Observables whose last values a summary has; slow runs have no contact numbers and order.
_LAST = ("phi", "pressure", "u", "z", "S_2", "S_4")
_COST = "flow_"  # of attributes that count the cost of implicit steps


class Ensemble(NamedTuple):
    """Common settings of compressions that differ only in their seed."""

    system: System
    n: int
    size_ratio: float
    """1 if not stored."""
    kappa: float
    """Last compression rate."""

    def report(self) -> dict[str, Any]:
        """Return a description for JSON."""
        own = {name: getattr(self, name) for name in ("n", "size_ratio", "kappa")}
        return self.system.report() | own


class Run(NamedTuple):
    """A compression and its onset phi_J(kappa), or one sentence on why there is none."""

    path: Path
    ensemble: Ensemble
    seed: int
    phi: FloatArray
    pressure: FloatArray
    fit: OnsetFit | None
    problem: str = ""
    jamming: Jamming | None = None
    """Bracket of jamming, if its frames were minimised."""


def ensemble_of(file: PackingFile) -> Ensemble:
    """Return the ensemble of a compression.

    Raises
    ------
    ValueError
        If its file lacks N or the rate.
    """
    missing = [name for name in ("n", "kappa") if name not in file.attributes]
    if missing:
        msg = f"{file.path}: has no attribute {missing[0]!r}, expected a run of compress.py"
        raise ValueError(msg)
    kappa = rate_of(file.attributes)
    ratio = float(file.attributes.get("size_ratio", 1.0))
    return Ensemble(file.system(), int(file.attributes["n"]), ratio, kappa)


def rate_of(attributes: Mapping[str, Any]) -> float:
    """Compression rate at the end of a run, [1/time].

    Examples
    --------
    >>> rate_of({"kappa": [[0.8, 1e-6], [0.9, 1e-8]]})  # from these packing fractions on
    1e-08
    """
    return float(np.ravel(attributes["kappa"])[-1])


def observables_of(file: PackingFile, names: Iterable[str]) -> dict[str, FloatArray]:
    """Read observables of a compression.

    Raises
    ------
    ValueError
        If one is missing.
    """
    names, found = list(names), read_observables(file.path)
    if not set(names) <= found.keys():
        msg = f"{file.path}: has no observables {', '.join(names)}, expected a run of compress.py"
        raise ValueError(msg)
    return {name: np.asarray(found[name], np.float64) for name in names}


def read_run(path: Path) -> Run:
    """Read p(phi) and fit its onset; errors as above."""
    file = PackingFile.read(path)
    phi, pressure = observables_of(file, ("phi", "pressure")).values()
    seed = int(file.attributes.get("seed", 0))
    run = Run(path, ensemble_of(file), seed, phi, pressure, None)
    run = run._replace(jamming=Jamming.stored(file.attributes))
    try:
        return run._replace(fit=fit_onset(phi, pressure, power=_power(file.attributes)))
    except ValueError as error:  # it ends below jamming, or rearranges too soon
        return run._replace(problem=f"{path}: {error}")


def _power(stored: Mapping[str, Any]) -> float:
    """Return the power of the law of contacts of a run."""
    return Interaction.told(stored).power


def summary_of(path: Path) -> dict[str, Any]:
    """Summarise a compression: its end, its cost, phi_J(kappa), and where frames stay jammed; errors as above."""
    observables, stored = read_observables(path), read_attributes(path)
    last = {name: float(observables[name][-1]) for name in _LAST if name in observables}
    cost = {
        name.removeprefix(_COST): float(value)
        for name, value in stored.items()
        if name.startswith(_COST)
    }
    noted = {name: stored[name] for name in ("left_out",) if name in stored}
    return {"out": str(path), **last, **cost, **noted} | onset_report(path)


def onset_report(path: Path) -> dict[str, Any]:
    """Report phi_J(kappa), the onset of p(phi), and the bracket of jamming, if known."""
    found, stored = read_observables(path), read_attributes(path)
    names, kappa = ("phi_J(kappa)", "phi_J(kappa)_error"), rate_of(stored)
    try:
        fit = fit_onset(found["phi"], found["pressure"], power=_power(stored))
    except ValueError:  # it ends below jamming
        fit = None
    told = dict(zip(names, fit[:2] if fit else (None, None), strict=True)) | {"kappa": kappa}
    jamming = Jamming.stored(stored)
    if jamming is None:
        return told
    return told | jamming.attributes() | {"onset": jamming.verdict(fit, kappa)}
