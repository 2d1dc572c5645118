"""A case of the stability battery and what it came to.

A case has an expectation: the largest error that is allowed, or the sentence with which it must stop.
"""

from __future__ import annotations

import re
import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple


class Verdict(NamedTuple):
    """What a case came to."""

    measured: float | str
    holds: bool
    seconds: float


@dataclass(frozen=True)
class Case:
    """One stiff or extreme situation.

    Parameters
    ----------
    part
        Of jamshape that is tried.
    name
        The situation.
    measure
        What the error is, or what stops.
    expected
        Largest error allowed, or a regular expression of the sentence.
    run
        Returns the error, or the sentence; may raise `ValueError` or `RuntimeError` for that.
    heavy
        Takes many seconds.
    """

    part: str
    name: str
    measure: str
    expected: float | str
    run: Callable[[], float | str]
    heavy: bool = False

    @property
    def label(self) -> str:
        """Name of the case that no other has."""
        return f"{self.part}: {self.name}"

    def judge(self) -> Verdict:
        """Run it; NaN, a warning of NumPy and a wrong sentence do not hold."""
        began = time.perf_counter()
        measured: float | str
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error", RuntimeWarning)
                found = self.run()
                measured = found if isinstance(found, str) else float(found)
        except (ValueError, RuntimeError, RuntimeWarning) as error:
            measured = f"{error}" or type(error).__name__
        if isinstance(self.expected, str):
            holds = isinstance(measured, str) and bool(re.search(self.expected, measured))
        else:
            holds = not isinstance(measured, str) and bool(measured <= self.expected)
        return Verdict(measured, holds, time.perf_counter() - began)
