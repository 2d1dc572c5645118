"""Names of attributes and observables, and their translation from earlier versions.

Earlier, `p` was the pressure, and in files of bodies with axis ratios `w1` and `w2` the exponent; the
protocols of Yuan et al. 2019 were numbered 1 and 2. Values that were renamed are in `jamshape.old_names`.
"""

from __future__ import annotations

from collections.abc import Container, Mapping
from typing import Any, TypeVar

from jamshape.old_names import stored

_Value = TypeVar("_Value")

FORMAT_VERSION = 2
"""Version of these names; 1 for files that do not state one."""

_OLD, _PRESSURE = "p", "pressure"

COMPRESSED, ATHERMAL, THERMAL = "marschall-2018", "yuan-2019-1", "yuan-2019-2"
"""Published protocols, by name."""

MINIMISED = "minimise"
"""Protocol of a state of one's own that was minimised at its box."""

NUMBERED: Mapping[int, str] = {1: ATHERMAL, 2: THERMAL}
"""Protocols that earlier versions numbered."""

_RATIO = "w1"  # only in files of bodies with an exponent


def renamed(found: Mapping[str, _Value]) -> dict[str, _Value]:
    """Return attributes or observables of a file under their current names.

    Entries with a current name stay as they are.

    Examples
    --------
    >>> renamed({"alpha": 4.0, "p": 1e-8})
    {'alpha': 4.0, 'pressure': 1e-08}
    >>> renamed({"p": 1.5, "w1": 1.0, "pressure": 1e-6})
    {'exponent': 1.5, 'w1': 1.0, 'pressure': 1e-06}
    >>> renamed({"way": "quasistatic", "outcome": "corner"})
    {'protocol': 'quasistatic', 'outcome': 'kink'}
    """
    names = {_OLD: "exponent" if _RATIO in found else _PRESSURE, "way": "protocol"}
    now = {names.get(name, name): value for name, value in found.items()}
    return {name: stored(name, value) for name, value in now.items()}


def protocol_named(value: Any) -> Any:
    """Return the name of a numbered protocol; other values stay as they are.

    Examples
    --------
    >>> protocol_named(2), protocol_named("2"), protocol_named("yuan-2019-1")
    ('yuan-2019-2', 'yuan-2019-2', 'yuan-2019-1')
    """
    return {str(number): name for number, name in NUMBERED.items()}.get(str(value), value)


def former(name: str, stored: Container[str]) -> str:
    """Return the name under which a file holds an observable: the current one, or that of earlier versions."""
    return _OLD if name == _PRESSURE and name not in stored else name
