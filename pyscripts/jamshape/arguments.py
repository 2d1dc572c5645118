"""Type checks of the arguments of public functions, from their annotations."""

from __future__ import annotations

import contextlib
import functools
import inspect
import numbers
import os
import sys
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ParamSpec, TypeVar

from jamshape.checks import RANGES, described, said

_P = ParamSpec("_P")
_R = TypeVar("_R")
_T = TypeVar("_T")


class ArgumentTypeError(TypeError, ValueError):
    """An argument has a type that the function does not accept; the message is one sentence."""


def checked(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Check the arguments of a public function against the types of its annotations.

    NumPy scalars and zero-dimensional arrays become Python numbers. Only classes, numbers, paths and sequences of
    these are checked; the rest is up to the function.

    Examples
    --------
    >>> @checked
    ... def double(number: float) -> float:
    ...     return 2 * number
    >>> double("1")
    Traceback (most recent call last):
    jamshape.arguments.ArgumentTypeError: number is '1', expected a number
    """
    return _checked(function, function.__globals__)


def checked_fields(record: type[_T]) -> type[_T]:
    """Check the fields of a dataclass as `checked` checks arguments."""
    names: dict[str, Any] = {}
    for one in reversed(record.__mro__):
        names |= vars(sys.modules[one.__module__])  # fields of a base use names of its module
    record.__init__ = _checked(record.__init__, names)  # type: ignore[method-assign]
    return record


def _checked(function: Callable[_P, _R], names: dict[str, Any]) -> Callable[_P, _R]:
    """Check arguments whose annotations hold names."""
    parameters = inspect.signature(function).parameters
    positions = list(parameters)
    rest = next((p.name for p in parameters.values() if p.kind is p.VAR_KEYWORD), "")

    @functools.cache
    def kinds_of(name: str) -> tuple[Any, ...]:
        known = parameters.get(name) or parameters.get(rest)
        return _kinds_of(known.annotation, names) if known else ()

    @functools.wraps(function)
    def call(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        # Missing or surplus arguments are left to Python's own error.
        first = [
            _taken(name, value, kinds_of(name))
            for name, value in zip(positions, args, strict=False)
        ]
        named = {name: _taken(name, value, kinds_of(name)) for name, value in kwargs.items()}
        return function(*first, *args[len(first) :], **named)  # type: ignore[arg-type]

    return call


def _kinds_of(annotation: Any, names: dict[str, Any]) -> tuple[Any, ...]:
    """Return the types of an annotation; none if one is unknown or imported only for type checkers."""
    if not isinstance(annotation, str):
        return ()
    try:
        kind = eval(annotation, names)
    except NameError:
        return ()
    kinds = typing.get_args(kind) if isinstance(kind, types.UnionType) else (kind,)
    return kinds if all(map(_is_known, kinds)) else ()


def _is_known(kind: Any) -> bool:
    """Return whether a type can be checked."""
    if kind is Any:
        return False
    return kind is None or isinstance(kind, type) or typing.get_origin(kind) in _SEVERAL


_SEVERAL = (Mapping, Sequence, tuple)


class _UnfitError(Exception):
    """A value does not have a type."""


def _taken(name: str, value: Any, kinds: tuple[Any, ...]) -> Any:
    """Return a value as the first of some types that it fits, or raise an `ArgumentTypeError`."""
    if not kinds or type(value) in kinds:
        return value
    with contextlib.suppress(_UnfitError):
        return _fitted_to_one(value, kinds)
    msg = f"{name} is {_shown(value)}, expected {_named(name, kinds)}{_pair_with(value, kinds)}"
    raise ArgumentTypeError(msg)


def _fitted_to_one(value: Any, kinds: tuple[Any, ...]) -> Any:
    """Return a value as the first of some types that it fits, or raise an `_UnfitError`."""
    for kind in kinds:
        with contextlib.suppress(_UnfitError):
            return _fitted(value, kind)
    raise _UnfitError


def _fitted(value: Any, kind: Any) -> Any:
    """Return a value as a type, or raise an `_UnfitError`."""
    if isinstance(kind, types.UnionType):
        return _fitted_to_one(value, typing.get_args(kind))
    if kind in _NUMBERS:
        return _number(value, kind)
    if kind in (None, types.NoneType):
        fits = value is None
    elif kind is Path:
        fits = isinstance(value, os.PathLike)
    elif isinstance(kind, type):
        fits = isinstance(value, kind)
    else:
        return (_mapping if typing.get_origin(kind) is Mapping else _sequence)(value, kind)
    if not fits:
        raise _UnfitError
    return value


_NUMBERS = {bool: numbers.Integral, int: numbers.Integral, float: numbers.Real}


def _number(value: Any, kind: Any) -> Any:
    if getattr(value, "shape", None) == () and not hasattr(value, "mask"):
        value = value.item()  # a NumPy scalar
    if kind is bool and isinstance(value, numbers.Integral) and value in (0, 1):
        return bool(value)
    if isinstance(value, bool) or not isinstance(value, _NUMBERS[kind]):
        raise _UnfitError
    return value if type(value) in _NUMBERS else kind(value)


def _mapping(value: Any, kind: Any) -> Any:
    if not isinstance(value, Mapping):
        raise _UnfitError
    _, of = typing.get_args(kind)
    return value if of is Any else {name: _fitted(one, of) for name, one in value.items()}


def _sequence(value: Any, kind: Any) -> Any:
    of = typing.get_args(kind)
    is_pair = typing.get_origin(kind) is tuple and Ellipsis not in of
    if isinstance(value, str | bytes) or not hasattr(value, "__len__"):
        raise _UnfitError
    if is_pair and len(value) != len(of):
        raise _UnfitError
    if not hasattr(value, "__iter__") or hasattr(value, "keys"):
        raise _UnfitError
    return tuple(_fitted(one, of[k] if is_pair else of[0]) for k, one in enumerate(value))


def _shown(value: Any) -> str:
    if isinstance(value, type):
        return f"the class {value.__name__} itself"
    if inspect.isroutine(value):
        return f"the function {value.__name__} itself"
    return said(value)


def _named(name: str, kinds: tuple[Any, ...]) -> str:
    """Describe the expected types."""
    if name in RANGES and set(kinds) & {int, float}:
        return described(RANGES[name])
    kinds = tuple(kind for kind in kinds if kind is not str) if Path in kinds else kinds
    return " or ".join(dict.fromkeys(_name(kind) for kind in kinds if kind is not types.NoneType))


def _pair_with(value: Any, kinds: tuple[Any, ...]) -> str:
    """Complete a single number that was given in place of a pair whose first number may be left out."""
    pairs = (typing.get_args(kind) for kind in kinds if typing.get_origin(kind) is tuple)
    is_half = isinstance(value, numbers.Real) and any(
        types.NoneType in typing.get_args(pair[0]) for pair in pairs
    )
    return f" such as (None, {said(value)})" if is_half else ""


def _name(kind: Any) -> str:
    if kind in _NAMES:
        return _NAMES[kind]
    if typing.get_origin(kind) is Mapping:
        return "a mapping of names to numbers"
    if typing.get_origin(kind) is tuple:
        return f"a tuple of {len(typing.get_args(kind))} numbers"
    if typing.get_origin(kind) is Sequence:
        (of,) = typing.get_args(kind)
        return f"a sequence, each {_name(of)}"
    return _NAMES.get(kind.__name__, f"a {kind.__name__}")


_NAMES = {
    bool: "True or False", int: "a whole number", float: "a number", str: "text", Path: "a path",
    "Particles": "particles such as Particles.of(alpha=4)", "Packing": "a packing",
    "Recorded": "a run", "Frames": "frames", "Living": "a LAMMPS instance", "Modes": "modes", "Interaction": "Interaction(k_e, sides, power)",
}  # fmt: skip
