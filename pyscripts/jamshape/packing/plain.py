"""Fields of a packing from plain arrays: sizes by the parameters of any shape, and boxes of several forms."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arrays import FloatArray, real_numbers
from jamshape.checks import Range, require_in
from jamshape.packing.box import Box
from jamshape.packing.given import as_floats
from jamshape.shapes.shape import Parameter, Shape

_EXPONENT = "exponent"  # not a matter of the diameters


class Bodies(NamedTuple):
    """Sizes of N particles, as in `Packing`."""

    diameters: ArrayLike
    form: FloatArray

    @classmethod
    def of(
        cls,
        shape: Shape,
        n: int,
        size: ArrayLike | None,
        diameters: ArrayLike | None,
        parameters: Mapping[str, ArrayLike],
    ) -> Bodies:
        """Take diameters, or parameters of a shape and a size, each a number or (N,).

        Raises
        ------
        ValueError
            If a parameter is missing, unknown, out of its range or given beside diameters, or an array has another
            shape.
        """
        known = {key: p for p in shape.parameters for key in (p.option, p.name)}
        for name in parameters:
            if name not in known:
                expected = ", ".join(p.option for p in shape.parameters)
                msg = f"{name} is not a parameter of {shape.name}s, expected {expected}"
                raise ValueError(msg)
        given: dict[str, Any] = {
            known[name].name: known[name].read(value)
            if known[name].allowed is None
            else _parameter(known[name], value, n)
            for name, value in parameters.items()
        }
        if diameters is not None:
            beside = {_EXPONENT, *(p.name for p in set(shape.parameters) - set(shape.needed))}
            surplus = ["size"] * (size is not None) + [name for name in given if name not in beside]
            if surplus:
                msg = f"{surplus[0]} is given beside diameters, which determine it; leave one of them out"
                raise ValueError(msg)
            reduced = shape.reduced(given)
            if set(reduced) <= {_EXPONENT}:
                return cls(diameters, shape.form_of_exponents(reduced.get(_EXPONENT, np.ones(n))))
            usual = {p.name: p.default for p in shape.needed}
            return cls(diameters, shape.sizes(usual | reduced, np.ones(n))[1])
        given = shape.reduced(given)
        needed = shape.reduced({p.name: p.default for p in shape.needed} | given)
        for parameter in shape.needed:
            if parameter.name in needed and parameter.name not in given:
                msg = f"{parameter.option} of {shape.name}s is missing, expected {parameter.meaning}, or diameters"
                raise ValueError(msg)
        lengths = _each("size", 1.0 if size is None else size, n)
        if not (lengths > 0).all():
            msg = f"size holds {lengths.min()}, expected positive lengths"
            raise ValueError(msg)
        return cls(*shape.sizes(given, lengths))


def box_of(box: Box | ArrayLike, lo: ArrayLike | None) -> Box:
    """Take a box, its edges (D,), or cell vectors as columns (D, D).

    Raises
    ------
    ValueError
        If it is none of these, or has its own lower corner and another one is given.
    """
    if isinstance(box, Box):
        if lo is not None:
            msg = "lo is given beside a Box, which has its own; leave it out"
            raise ValueError(msg)
        return box
    shape = real_numbers("box", box).shape
    if shape not in {(2,), (3,), (2, 2), (3, 3)}:
        msg = f"box has shape {shape}, expected (D,) edges or (D, D) cell vectors as columns, D = 2 or 3"
        raise ValueError(msg)
    lengths = as_floats("box", box, shape)
    corner = np.zeros(shape[0]) if lo is None else np.asarray(real_numbers("lo", lo), np.float64)
    if lengths.ndim == 1:
        return Box(corner, lengths)
    if np.tril(lengths, -1).any() and not np.triu(lengths, 1).any():
        msg = (
            f"box is the lower triangular matrix {lengths.tolist()}, expected an upper triangular one, whose columns"
            " are the cell vectors; transpose it"
        )
        raise ValueError(msg)
    return Box.of(corner, lengths)


def unturned(n: int, dimension: int) -> FloatArray:
    """Orientations (N,) or (N, 4) of particles that are not rotated."""
    return np.zeros(n) if dimension == 2 else np.tile(np.eye(1, 4), (n, 1))


def _parameter(parameter: Parameter, value: ArrayLike, n: int) -> FloatArray:
    """Return a parameter of n particles, or raise a ValueError."""
    found, allowed = _each(parameter.option, value, n), parameter.allowed or Range(-np.inf, np.inf)
    fits = ((allowed.low <= found) & (found <= allowed.high)) | np.isin(found, allowed.also)
    for wrong in found[~fits][:1]:
        require_in(parameter.option, float(wrong), allowed)
    return found


def _each(name: str, value: Any, n: int) -> FloatArray:
    """Return (n,) numbers from these or from one number."""
    shape = real_numbers(name, value).shape
    if shape not in {(), (n,)}:
        msg = f"{name} has shape {shape}, expected a number or {(n,)}"
        raise ValueError(msg)
    return np.broadcast_to(as_floats(name, value, shape), (n,))
