"""Names of attributes and observables: files of earlier versions speak today's language.

Earlier, `p` was the pressure, and in files of bodies with the axis ratios `w1` and `w2` the exponent; the
protocols of Yuan et al. 2019 were the numbers 1 and 2.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any, TypeVar

_Value = TypeVar("_Value")

FORMAT_VERSION = 2
"""Of files whose names are these; 1 is that of files that do not say."""

_OLD, _PRESSURE = "p", "pressure"

RENAMED = (_PRESSURE,)
"""Observables that had another name."""

COMPRESSED, ATHERMAL, THERMAL = "marschall-2018", "yuan-2019-1", "yuan-2019-2"
"""Protocols as published, by name."""

NUMBERED: Mapping[int, str] = {1: ATHERMAL, 2: THERMAL}
"""Those that earlier versions called by numbers."""

_RATIO = "w1"  # only files of bodies with an exponent have it


def renamed(found: Mapping[str, _Value]) -> dict[str, _Value]:
    """Return attributes or observables of a file the names that they have today.

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


def protocol_named(value: Any) -> Any:
    """Return a protocol its name; what is no number of one stays as it is.

    Examples
    --------
    >>> protocol_named(2), protocol_named("yuan-2019-1")
    ('yuan-2019-2', 'yuan-2019-1')
    """
    is_number = isinstance(value, int) and not isinstance(value, bool)
    return NUMBERED.get(value, value) if is_number else value


def read_protocol(text: str) -> str:
    """Read a protocol from the words of a command: its name, or its number.

    Examples
    --------
    >>> read_protocol("2"), read_protocol("marschall-2018")
    ('yuan-2019-2', 'marschall-2018')
    """
    return str(protocol_named(int(text))) if text.isdecimal() else text


def former(name: str, stored: Container[str]) -> str:
    """Name under which a file holds an observable: today's, or that of earlier versions."""
    return _OLD if name == _PRESSURE and name not in stored else name
