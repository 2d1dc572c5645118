"""A packing with its contacts, pressure, pictures and exports."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from jamshape.arguments import checked, checked_fields
from jamshape.arrays import BoolArray
from jamshape.contacts import Contacts
from jamshape.contacts.network import sum_forces
from jamshape.files.disk import named, settled
from jamshape.files.h5md import read_attributes, read_packing
from jamshape.files.outcomes import AT_REST, is_reached, shortfall
from jamshape.packing import Packing
from jamshape.recording.driver import KIND

_SAME_PHI = 1e-6  # relative; more than any rounding, and than that of boxes in single precision

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.front.modes import Modes


@checked_fields
@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredPacking(Packing):
    """A `Packing` with its metadata and everything that can be computed from it.

    Contacts follow its law, ``packing.law``, which copies and files keep.

    Parameters
    ----------
    results : mapping of str to number or str
        Attributes of its file: how it was made and what was measured.
    file : Path, optional
        File it was read from.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> packing.z, packing.results["outcome"]
    (5..., 'converged')
    >>> packing.contacts()
    <4... contacts of 16 particles: z = 5... bonds per particle, 0 rattlers left out>
    """

    results: Mapping[str, Any] = field(default_factory=dict)
    file: Path | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "file", settled(self.file))

    @classmethod
    def of(
        cls, packing: Packing, results: Mapping[str, Any] | None = None, file: Path | None = None
    ) -> Self:
        """Convert any packing."""
        known = {name: getattr(packing, name) for name in Packing.__dataclass_fields__}
        return cls(**known, results=dict(results or {}), file=file)

    @classmethod
    def read(cls, path: Path, frame: int = -1) -> Self:
        """Read one frame of an H5MD file; errors as `jamshape.files.h5md.read_packing`."""
        packing = read_packing(path, frame)
        return cls.of(packing, results_of(path, packing), path)

    def with_(self, **changes: Any) -> Self:
        """Return a packing with the named fields replaced, and without results and file."""
        return super().with_(**({"results": {}, "file": None} | changes))  # type: ignore[return-value]

    @cached_property
    def _contacts(self) -> Contacts:
        return Contacts.of(self)

    def contacts(self) -> Contacts:
        """Find the contacts.

        Returns
        -------
        Contacts
            With ``pairs``, ``force``, ``z``, ``rattlers`` and all points of contact in ``network``.

        Raises
        ------
        CrossingError
            If the cores (spines or centres) of two particles cross.
        """
        return self._contacts

    @property
    def reached(self) -> bool:
        """Whether forces balance to the tolerance; True where the file does not say."""
        return "outcome" not in self.results or is_reached(self.results)

    @property
    def z(self) -> float:
        """Bonds per particle, rattlers excluded (Marschall & Teitel 2018, Sec. III C)."""
        return self._contacts.z

    @property
    def rattlers(self) -> BoolArray:
        """(N,) whether the particle is a rattler, not held in place by its contacts."""
        return self._contacts.rattlers

    @property
    def u(self) -> float:
        """Elastic energy over the box's area (volume), [energy / length^D]."""
        return float(self._contacts.energy.sum()) / self.box.volume

    @property
    def pressure(self) -> float:
        """-dU/dV under affine changes of the box, [energy / length^D]."""
        return sum_forces(self, self._contacts.network).pressure

    def modes(self, **how: Any) -> Modes:
        """Find the modes of vibration; arguments and errors as in `jamshape.modes`."""
        from jamshape.front.modes import modes  # noqa: PLC0415 - which knows packings

        return modes(self, **how)

    def plot(self, axes: Axes | None = None, **look: Any) -> Axes:
        """Draw the packing; arguments as in `jamshape.plot`."""
        from jamshape.front.pictures import plot  # noqa: PLC0415 - which knows packings

        return plot(self, axes, **look)

    @checked
    def save(self, path: str | Path) -> None:
        """Write the packing to a file; see `jamshape.save`."""
        from jamshape.front.files import save  # noqa: PLC0415 - which knows packings

        save(path, self)

    @property
    def to_store(self) -> dict[str, Any]:
        """Return the results without attributes of a run: a single frame cannot be continued as a run."""
        return {k: v for k, v in self.results.items() if k not in {KIND, "finished"}}

    @checked
    def to_gsd(self, path: str | Path) -> None:
        """Write the packing as GSD for HOOMD-blue, OVITO and freud; needs the package gsd."""
        from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

        write_gsd(path, self)

    def to_freud(self) -> Any:
        """Return arguments of freud's functions; see `jamshape.exchange.freud.to_freud`."""
        from jamshape.exchange.freud import to_freud  # noqa: PLC0415 - freud may be missing

        return to_freud(self)

    def to_ovito(self) -> Any:
        """Return an `ovito.data.DataCollection`; see `jamshape.exchange.ovito.to_ovito`."""
        from jamshape.exchange.ovito import to_ovito  # noqa: PLC0415 - ovito may be missing

        return to_ovito(self, self.rattlers)

    def to_mdanalysis(self) -> Any:
        """Return an `MDAnalysis.Universe`; see `jamshape.exchange.mdanalysis.to_mdanalysis`."""
        from jamshape.exchange.mdanalysis import (  # noqa: PLC0415 - MDAnalysis may be missing
            to_mdanalysis,
        )

        return to_mdanalysis(self)

    def __repr__(self) -> str:
        said = [f"phi = {self.phi:.6g}"]
        known = (("pressure", "pressure"), ("u", "u"), ("z", "z"), ("n_rattlers", "rattlers"))
        numbers = {name: self.results.get(key) for key, name in known}
        said += [f"{k} = {v:.4g}" for k, v in numbers.items() if _is_number(v)]
        if not self.reached:
            outcome = self.results["outcome"]
            unbalanced = f"{outcome}: forces do not balance"
            said.append(shortfall(self.results) if outcome in AT_REST else unbalanced)
        said += [f"in {named(self.file)}"] if self.file else []
        what = f"{self.n} {self.shape.name}s in {self.dimension}D"
        return f"<Packing of {what}: {', '.join(said)}>"

    def _repr_html_(self) -> str:
        from jamshape.front.pictures import html  # noqa: PLC0415 - only notebooks ask

        return html(self)


def results_of(path: Path, packing: Packing) -> dict[str, Any]:
    """Read the results stored with a packing; none, with a warning, if its particles were changed since.

    Errors are those of `read_packing`.
    """
    known = read_attributes(path)
    if "outcome" not in known or not _is_number(known.get("phi")):
        return known
    phi = float(known["phi"])
    if abs(phi - packing.phi) <= _SAME_PHI * packing.phi:
        return known
    said = (
        f"{path}: its attributes state phi = {phi:.8g} but its particles have phi = {packing.phi:.8g}; another program"
        " changed them, so the stored results are ignored"
    )
    warnings.warn(said, stacklevel=3)
    return {}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number)
