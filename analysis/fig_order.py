"""Draw orientational order against packing fraction (Fig. 2 of the paper below).

    python analysis/fig_order.py RUN.h5 [MORE.h5 ...] --out order.png

Runs of pyscripts/compress.py that differ in their seed only are averaged. sqrt(N) S_n that depends
neither on N nor on phi, at the dashed line, is the order of random orientations: none. The last
line of standard output is one JSON object with the averages over phi.

Marschall & Teitel, Phys. Rev. E 97, 012905 (2018).
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from jamshape.packing import FloatArray
from jamshape.storage import read_attributes, read_observables

ENSEMBLE = {"n": "N", "alpha": r"\alpha", "kappa": r"\kappa", "size_ratio": "R_b/R_s"}
ORDERS = ("S_2", "S_4")
POINTS = 30
RANDOM = np.sqrt(np.pi) / 2

Ensemble = tuple[Any, ...]


def read(paths: list[Path]) -> dict[Ensemble, list[dict[str, FloatArray]]]:
    """Read the observables of all runs, by ensemble in the order of N."""
    runs: dict[Ensemble, list[dict[str, FloatArray]]] = {}
    for path in paths:
        observables, attributes = read_observables(path), read_attributes(path)
        if not {"phi", *ORDERS} <= observables.keys() or "n" not in attributes:
            msg = f"{path}: has no observables phi, S_2, S_4, expected a run of compress.py"
            raise ValueError(msg)
        key = tuple(attributes.get(name, np.nan) for name in ENSEMBLE)
        runs.setdefault(key, []).append(observables)
    return dict(sorted(runs.items()))


def average(n: int, runs: list[dict[str, FloatArray]]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean of sqrt(N) S_n over the samples, with its error, where all samples have been.

    Returns
    -------
    phi : (POINTS,)
    mean, error : (2, POINTS), for `ORDERS`; the error is NaN where there is one sample only.
    """
    start, end = max(run["phi"][0] for run in runs), min(run["phi"][-1] for run in runs)
    if not start < end:
        msg = f"runs with N = {n} share no range of phi, expected compressions that overlap"
        raise ValueError(msg)
    phi = np.linspace(start, end, POINTS)
    S = np.array([[np.interp(phi, run["phi"], run[name]) for name in ORDERS] for run in runs])
    samples = len(runs)
    error = S.std(axis=0) / np.sqrt(samples - 1) if samples > 1 else np.full(S.shape[1:], np.nan)
    return phi, np.sqrt(n) * S.mean(axis=0), np.sqrt(n) * error


def label(key: Ensemble, keys: list[Ensemble], samples: int) -> str:
    """N, and what else differs between the ensembles."""
    differ = [len(set(values)) > 1 for values in zip(*keys, strict=True)]
    shown = [
        rf"${symbol} = {value:g}$"
        for k, (symbol, value) in enumerate(zip(ENSEMBLE.values(), key, strict=True))
        if k == 0 or differ[k]
    ]
    return ", ".join(shown) + (f" ({samples} samples)" if samples > 1 else "")
