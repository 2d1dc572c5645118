"""Old names of arguments, options and values, accepted for one release with a warning that gives the new one."""

from __future__ import annotations

import functools
import sys
import warnings
from argparse import SUPPRESS, Action, ArgumentParser
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

_P = ParamSpec("_P")
_R = TypeVar("_R")

VALUES = {
    "search": {"direct": "extrapolation", "halving": "bisection"},
    "minimiser": {"paper": "cg_marschall"},
    "method": {"paper": "cg_marschall"},
    "outcome": {"corner": "kink"},
}
"""New values by name and old value."""

_SAID = "{} is called {} now; the old name goes with the next release"


def accepts_old(**names: str) -> Callable[[Callable[_P, _R]], Callable[_P, _R]]:
    """Let a function accept old names of arguments, given as ``old="new"``, and old values of all arguments.

    Its attribute `old_names` holds the names.

    Examples
    --------
    >>> @accepts_old(way="protocol")
    ... def make(protocol="quasistatic"):
    ...     return protocol
    >>> with warnings.catch_warnings(action="ignore"):
    ...     make(way="steps")
    'steps'
    """

    def decorated(function: Callable[_P, _R]) -> Callable[_P, _R]:
        @functools.wraps(function)
        def call(*args: _P.args, **given: _P.kwargs) -> _R:
            for old, new in names.items():
                if old not in given:
                    continue
                if given.get(new) is not None:
                    msg = f"{old} is an old name of {new}, which is given as well; leave {old} out"
                    raise ValueError(msg)
                _warn(old, new, stacklevel=3)
                given[new] = given.pop(old)
            for name in VALUES.keys() & given.keys():
                given[name] = current(name, given[name])
            return function(*args, **given)

        call.old_names = names  # type: ignore[attr-defined]
        return call

    return decorated


def current(name: str, value: Any) -> Any:
    """Return today's value for an old one, with a warning; others as they are."""
    new = VALUES.get(name, {}).get(value) if isinstance(value, str) else None
    if new is None:
        return value
    _warn(f"{name} {value!r}", repr(new), stacklevel=4)
    return new


def renamed_class(old: str, new: type) -> type:
    """Return a class for its old name, with a warning."""
    _warn(old, new.__name__, stacklevel=4)
    return new


def add_old_option(parser: ArgumentParser, old: str, new: str, **keywords: Any) -> None:
    """Let a command accept the old name of an option, which its help does not show.

    Parameters
    ----------
    parser
    old : str
        Such as ``--way``.
    new : str
        Such as ``--protocol``.
    **keywords
        As of the new option: `type`, `choices`.
    """
    parser.add_argument(
        old,
        dest=new[2:].replace("-", "_"),
        action=_OldOption,
        help=SUPPRESS,
        metavar=new,
        **keywords,
    )


def add_old_flag(parser: ArgumentParser, old: str, instead: str) -> None:
    """Let a command accept an option without a value that is no longer needed, which its help does not show.

    Parameters
    ----------
    parser
    old : str
        Such as ``--resume``.
    instead : str
        Present behaviour without it, for the warning.
    """
    parser.add_argument(
        old, action=_OldFlag, nargs=0, default=False, help=SUPPRESS, metavar=instead
    )


class _OldFlag(Action):
    def __call__(
        self, parser: Any, namespace: Any, _values: Any, option_string: Any = None
    ) -> None:
        print(
            f"{parser.prog}: warning: {self.metavar} without {option_string}, which goes with the next release",
            file=sys.stderr,
        )
        setattr(namespace, self.dest, True)


class _OldOption(Action):
    def __call__(
        self, parser: Any, namespace: Any, _values: Any, option_string: Any = None
    ) -> None:
        print(
            f"{parser.prog}: warning: {_SAID.format(option_string, self.metavar)}", file=sys.stderr
        )
        setattr(namespace, self.dest, _values)


def _warn(old: str, new: str, stacklevel: int) -> None:
    warnings.warn(_SAID.format(old, new), FutureWarning, stacklevel=stacklevel)
