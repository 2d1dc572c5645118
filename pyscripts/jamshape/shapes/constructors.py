"""Constructors of particles, made from the parameters of a shape: ``Spherocylinders(alpha=4)``."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from inspect import Signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.arguments import checked
from jamshape.arrays import real_numbers
from jamshape.shapes.particles import OF_A_KIND, Kind, Particles
from jamshape.shapes.shape import HARMONIC, Parameter, Shape

_TABLE = 2  # dimensions

_TEXT = """{about}

Parameters
----------
{parameters}
size_ratio : float, optional
    Size ratio of big and small particles, mixed 1:1, with the same parameters; {size_ratio:g} by default, 1 for
    equal particles.
law : str or float, optional
    Law of the contacts: ``"harmonic"`` (default), ``"hertz"``, or the power of the overlap in the energy of a contact, at
    least 2.
**kinds : float or (k,) array
    ``size`` over the unit of length, {unit} (1); ``share``, number fraction of the kind up to normalisation (1);
    ``spread``, standard deviation of the logarithm of the size (0). These exclude `size_ratio`. Arrays make a
    mixture of k kinds.

Returns
-------
Particles

Raises
------
ValueError
    If a number is out of its range, or arrays differ in length.

Examples
--------
>>> import jamshape as js
>>> js.{name}({example}, size_ratio=1.25)
{made!r}
>>> mixture = js.{name}({example}, size=[1, 1.4], share=[3, 1])
"""


def constructor(shape: Shape) -> Callable[..., Particles]:
    """Make the function whose arguments are the parameters of a shape, each a number or an array.

    Examples
    --------
    >>> from jamshape.shapes.table import shape_named
    >>> constructor(shape_named("dimer"))(alpha=0.5, size_ratio=1)
    Particles('dimer', alpha=0.5, size_ratio=1)
    """
    signature = signature_of(shape)

    def make(*args: ArrayLike, **kwargs: ArrayLike) -> Particles:
        given = signature.bind(*args, **kwargs)
        numbers = dict(given.arguments)  # without defaults, which contradict nothing
        law, ratio = numbers.pop("law", HARMONIC), numbers.pop("size_ratio", None)
        return _particles(shape, numbers, ratio, numbers.pop("kinds", {})).under(law)

    make.__signature__ = signature  # type: ignore[attr-defined]
    make.__name__ = make.__qualname__ = shape.compiled_name
    make.__module__ = "jamshape.shapes.named"
    make.__doc__ = _text_of(shape)
    return checked(make)


def signature_of(shape: Shape) -> Signature:
    """Signature of the constructor of a shape, with types as text."""
    either = inspect.Parameter.POSITIONAL_OR_KEYWORD
    arguments = [
        inspect.Parameter(
            p.option,
            either,
            default=p.default,
            annotation="ArrayLike" if p.default is not None else "ArrayLike | None",
        )
        for p in shape.parameters
    ]
    ratio = inspect.Parameter("size_ratio", either, default=None, annotation="float | None")
    law = inspect.Parameter("law", either, default="harmonic", annotation="str | float")
    kinds = inspect.Parameter("kinds", inspect.Parameter.VAR_KEYWORD, annotation="ArrayLike")
    return Signature([*arguments, ratio, law, kinds], return_annotation="Particles")


def _text_of(shape: Shape) -> str:
    parameters = "\n".join(
        f"{p.option} : {'array_like or str' if isinstance(p.default, str) else 'float or (k,) array'}\n    {p.meaning}; {p.usual} by default."
        for p in shape.parameters
    )
    first = dict(shape.examples[0])
    return _TEXT.format(
        about=inspect.getdoc(shape),
        parameters=parameters,
        size_ratio=shape.size_ratio,
        unit=shape.unit,
        name=shape.compiled_name,
        example=", ".join(
            f"{p.option}={_shown(first[p.name])}" for p in shape.parameters if p.name in first
        ),
        made=Particles.of(shape, 1.25, **first),
    )


def _texts(parameter: Parameter, value: Any) -> Any:
    """Return a parameter that is read from a text or a table as one object, or those of several kinds."""
    is_several = isinstance(value, list | tuple | np.ndarray) and all(
        isinstance(one, str) or np.ndim(one) == _TABLE for one in value
    )
    found = np.empty(len(value) if is_several else (), object)
    for k in range(len(value)) if is_several else ():
        found[k] = parameter.read(value[k])
    if not is_several:
        found[()] = parameter.read(value)
    return found


def _shown(value: float | str) -> str:
    return repr(value) if isinstance(value, str) else f"{value:g}"


def _particles(
    shape: Shape,
    parameters: Mapping[str, ArrayLike | None],
    size_ratio: float | None,
    kinds: Mapping[str, ArrayLike],
) -> Particles:
    """Make particles from numbers, or kinds from arrays."""
    for name in kinds:
        if name not in OF_A_KIND:
            options = [p.option for p in shape.parameters]
            expected = ", ".join((*options, "size_ratio", *OF_A_KIND))
            msg = f"{name} is unknown for {shape.name}s, expected {expected}"
            raise ValueError(msg)
    texts = {p.option: p for p in shape.parameters if isinstance(p.default, str)}
    replacing = {p.option for p in shape.parameters if p not in shape.needed}
    given: dict[str, Any] = {**parameters, **kinds}
    values: dict[str, Any] = {
        k: _texts(texts[k], v) if k in texts else real_numbers(k, v)
        for k, v in given.items()
        if v is not None or k not in replacing
    }
    if not kinds and all(np.ndim(value) == 0 for value in values.values()):
        return Particles.of(shape, size_ratio, **{k: v.item() for k, v in values.items()})
    if size_ratio is not None:
        msg = "size_ratio does not work with kinds, expected the size of each kind in size alone"
        raise ValueError(msg)
    try:
        columns = np.broadcast_arrays(
            *(
                np.atleast_1d(v).astype(object if k in texts else np.float64)
                for k, v in values.items()
            )
        )
    except ValueError:
        lengths = {name: np.size(value) for name, value in values.items()}
        msg = f"arrays have lengths {lengths}, expected one entry for each kind"
        raise ValueError(msg) from None
    rows = [
        dict(zip(values, row, strict=True))
        for row in zip(*(column.tolist() for column in columns), strict=True)
    ]
    own = [{name: row.pop(name) for name in kinds} for row in rows]
    return Particles.mixture(shape, [Kind(row, **k) for row, k in zip(rows, own, strict=True)])
