"""Names of attributes and observables: files of earlier versions speak today's language.

Earlier, `p` was the pressure, and in files of bodies with the axis ratios `w1` and `w2` the exponent.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import TypeVar

_Value = TypeVar("_Value")

FORMAT_VERSION = 2
"""Of files whose names are these; 1 is that of files that do not say."""

_OLD, _PRESSURE = "p", "pressure"

RENAMED = (_PRESSURE,)
"""Observables that had another name."""

_RATIO = "w1"  # only files of bodies with an exponent have it


def renamed(found: Mapping[str, _Value]) -> dict[str, _Value]:
    """Give attributes or observables of a file the names that they have today.

    What has such a name already stays as it is.

    Examples
    --------
    >>> renamed({"alpha": 4.0, "p": 1e-8})
    {'alpha': 4.0, 'pressure': 1e-08}
    >>> renamed({"p": 1.5, "w1": 1.0, "pressure": 1e-6})
    {'exponent': 1.5, 'w1': 1.0, 'pressure': 1e-06}
    """
    new = "exponent" if _RATIO in found else _PRESSURE
    return {new if name == _OLD else name: value for name, value in found.items()}


def former(name: str, stored: Container[str]) -> str:
    """Name under which a file holds an observable: today's, or that of earlier versions."""
    return _OLD if name == _PRESSURE and name not in stored else name
