"""Parameters of which the default suite takes some; `-m validate` runs the others."""

from __future__ import annotations

import itertools
from collections.abc import Container, Iterable
from typing import Any

import pytest


def in_turn(*columns: Any, kept: Container[str] | None = None) -> list[Any]:
    """Return all combinations of parameters; in the default suite only those that take turns: each value occurs.

    With `kept` the default suite takes only these of the first ones.
    """
    every = []
    for numbers in itertools.product(*(range(len(column)) for column in columns)):
        values = [column[k] for column, k in zip(columns, numbers, strict=True)]
        first, *others = numbers
        is_quick = all(
            k == first % len(column) for k, column in zip(others, columns[1:], strict=True)
        )
        is_quick &= kept is None or values[0] in kept
        every.append(pytest.param(*values, marks=() if is_quick else pytest.mark.validate))
    return every


def quick(names: Iterable[str], kept: Container[str]) -> list[Any]:
    """Return parameters, of which the default suite takes those that are kept."""
    return [n if n in kept else pytest.param(n, marks=pytest.mark.validate) for n in names]
