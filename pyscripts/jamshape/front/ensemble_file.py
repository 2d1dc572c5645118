"""Recorded ensembles."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jamshape.arguments import checked
from jamshape.arrays import BoolArray, IntArray
from jamshape.checks import NotReachedWarning
from jamshape.files.frames import row_of
from jamshape.files.h5md import read_origin
from jamshape.front.packing import Packing
from jamshape.front.run import Recorded
from jamshape.protocols.ensemble import FAILED, kept_file


class EnsembleFile(Recorded):
    """An ensemble of packings in its H5MD file, a row for each seed; parameters as in `Recorded`.

    ``table["phi_J"]`` looks up a column: phi, phi_J, pressure, u, z, z_single, n_rattlers, S2, residual, evaluations,
    wall_seconds and others by the names of packings' results; NaN where a sample failed, or has none. It holds no
    packings; those kept in a folder are read by ``table.packing(row)``.

    Examples
    --------
    >>> import jamshape as js
    >>> table = js.ensemble(js.Spherocylinders(alpha=1), n=16, seeds=range(4), u0=1e-8, progress=False)
    >>> table
    <Ensemble of 16 spherocylinders in 2D: 4 samples, 4 of them at rest, phi_J = 0.8...>
    >>> table["z"].shape, table.failures
    ((4,), {})
    """

    @property
    def seeds(self) -> IntArray:
        """(S,) seeds of the rows."""
        return self["seed"].astype(np.int64)

    @property
    def reached(self) -> BoolArray:
        """(S,) whether forces balance to the tolerance."""
        return self["reached"].astype(bool)

    @property
    def outcome(self) -> NDArray[np.str_]:
        """(S,) outcome of each sample, such as ``converged``, or ``failed`` without a packing."""
        names = np.array(str(self.about["outcomes"]).split())
        return np.asarray(names[self["outcome"].astype(int)])

    @property
    def failures(self) -> dict[int, str]:
        """Reasons for which samples failed, or did not reach their goal, by seed."""
        return {int(seed): why for seed, why in json.loads(self.about["failures"]).items()}

    @property
    def origin(self) -> str:
        """Type of machine on which the last bits depend."""
        return read_origin(self.file)

    @checked
    def packing(self, frame: int = -1) -> Packing:
        """Read the packing of a row, counted from 0 or, if negative, from the end.

        Raises
        ------
        ValueError
            If the packings were not kept in a folder, or this sample failed.
        """
        row = row_of(frame, len(self), self.file)
        seed = int(self.seeds[row])
        path = kept_file(self.about, seed)
        if path is None:
            return super().packing()  # raises, since a table holds no packings
        if self.outcome[row] == FAILED:
            msg = f"the sample of seed {seed} failed, expected one with a packing: {self.failures[seed]}"
            raise ValueError(msg)
        return Packing.read(path)

    def __iter__(self) -> Iterator[Packing]:
        """Read the packings of all rows."""
        return (self.packing(row) for row in range(len(self)))

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`, a row for each seed; needs the package pandas."""
        import pandas as pd  # type: ignore[import-untyped] # noqa: PLC0415 - may be missing

        columns = {"seed": self.seeds, "outcome": self.outcome, "reached": self.reached}
        return pd.DataFrame(
            columns | {k: v for k, v in self.observables.items() if k not in columns}
        )

    def warn_unless_reached(self) -> None:
        """Warn if samples failed, or did not reach their goal."""
        if failures := self.failures:
            seed, why = next(iter(failures.items()))
            said = (
                f"{len(failures)} of {len(self)} samples failed or did not reach their goal, expected none: the"
                f" first, seed {seed}: {why}; failures lists all"
            )
            warnings.warn(NotReachedWarning(said, {}), stacklevel=3)

    def __len__(self) -> int:
        """Count the samples so far."""
        return len(self.observables.get("seed", ()))

    def __repr__(self) -> str:
        jammed = self["phi_J"][self.reached]
        mean = f", phi_J = {jammed.mean():.5g} +- {jammed.std():.2g}" if len(jammed) else ""
        return f"<Ensemble of {self._who()}: {len(self)} samples, {self.reached.sum()} of them at rest{mean}{self._where()}>"
