"""A packing with what one asks of it: contacts, pressure, pictures, files of other tools."""

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

_SAME_PHI = 1e-6  # relative; more than any rounding, and than that of boxes in single precision

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from jamshape.front.modes import Modes


@checked_fields
@dataclass(frozen=True, eq=False, kw_only=True)
class MeasuredPacking(Packing):
    """A `Packing` with what is known of it and what can be asked of it.

    Its contacts have the law that it carries, ``packing.law``, as its copies and files do.

    Parameters
    ----------
    results : mapping of str to number or str
        What its file says of it: how it was made and what was measured.
    file : Path, optional
        Where it was read from.

    Examples
    --------
    >>> import jamshape as js
    >>> rods = js.Spherocylinders(alpha=1)
    >>> packing = js.make_packing(rods, n=16, u0=1e-8, file="packing.h5", progress=False)
    >>> packing.z, packing.results["outcome"]
    (5..., 'converged')
    >>> packing.contacts()
    <4... contacts of 16 particles: z = 5... bonds for each of the 16 that are no rattlers>
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
        """Take the particles of any packing."""
        known = {name: getattr(packing, name) for name in Packing.__dataclass_fields__}
        return cls(**known, results=dict(results or {}), file=file)

    @classmethod
    def read(cls, path: Path, frame: int = -1) -> Self:
        """Read one frame of an H5MD file; errors as `jamshape.files.h5md.read_packing`."""
        packing = read_packing(path, frame)
        return cls.of(packing, results_of(path, packing), path)

    def with_(self, **changes: Any) -> Self:
        """Return a packing with the named fields replaced, of which its file says nothing any more."""
        return super().with_(**({"results": {}, "file": None} | changes))  # type: ignore[return-value]

    @cached_property
    def _contacts(self) -> Contacts:
        return Contacts.of(self)

    def contacts(self) -> Contacts:
        """Find its contacts.

        Returns
        -------
        Contacts
            With ``pairs``, ``force``, ``z``, ``rattlers`` and all points of contact in ``network``.

        Raises
        ------
        CrossingError
            If what must not cross of two particles does.
        """
        return self._contacts

    @property
    def reached(self) -> bool:
        """Whether it reached its goal, forces that balance; True where its file says nothing of that."""
        return "outcome" not in self.results or is_reached(self.results)

    @property
    def z(self) -> float:
        """Bonds per particle that is no rattler (Marschall & Teitel 2018, Sec. III C)."""
        return self._contacts.z

    @property
    def rattlers(self) -> BoolArray:
        """(N,) which particles their contacts do not hold in place."""
        return self._contacts.rattlers

    @property
    def u(self) -> float:
        """Elastic energy over the box's area (volume), [energy / length^D]."""
        return float(self._contacts.energy.sum()) / self.box.volume

    @property
    def pressure(self) -> float:
        """-dU/dV of affine changes of the box, [energy / length^D]."""
        return sum_forces(self, self._contacts.network).pressure

    def modes(self, **how: Any) -> Modes:
        """Find its modes of vibration; arguments and errors as in `jamshape.modes`."""
        from jamshape.front.modes import modes  # noqa: PLC0415 - which knows packings

        return modes(self, **how)

    def plot(self, axes: Axes | None = None, **look: Any) -> Axes:
        """Draw it; arguments as in `jamshape.plot`."""
        from jamshape.front.pictures import plot  # noqa: PLC0415 - which knows packings

        return plot(self, axes, **look)

    @checked
    def save(self, path: str | Path) -> None:
        """Write it, as `jamshape.save`: how says the end of the name."""
        from jamshape.front.files import save  # noqa: PLC0415 - which knows packings

        save(path, self)

    @property
    def to_store(self) -> dict[str, Any]:
        """Return the results without what tells of a run: a frame is not that run, which could be gone on with."""
        return {k: v for k, v in self.results.items() if k != "finished"}

    @checked
    def to_gsd(self, path: str | Path) -> None:
        """Write it for HOOMD-blue, OVITO and freud; needs the package gsd."""
        from jamshape.exchange.gsd import write_gsd  # noqa: PLC0415 - gsd may be missing

        write_gsd(path, self)

    def to_freud(self) -> Any:
        """Return what freud's functions take; see `jamshape.exchange.freud.to_freud`."""
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
    """Read what a file says of a packing in it; nothing, with a warning, if its particles were changed since.

    Errors are those of `read_packing`.
    """
    known = read_attributes(path)
    if "outcome" not in known or not _is_number(known.get("phi")):
        return known
    phi = float(known["phi"])
    if abs(phi - packing.phi) <= _SAME_PHI * packing.phi:
        return known
    said = (
        f"{path}: its attributes say phi = {phi:.8g} and its particles have phi = {packing.phi:.8g}: another program has"
        " changed them, and what the file says of its packing is left out"
    )
    warnings.warn(said, stacklevel=3)
    return {}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number)
