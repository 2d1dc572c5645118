"""Parametrised tests of extreme cases: a function measures an error, which has a bound, or must stop with a sentence."""

from __future__ import annotations

import re
import time
import warnings
from inspect import signature
from typing import NamedTuple

import pytest
from known_failures import KNOWN

_LABELS = set()

# Ten thousand images for each of its pairs.
_HEAVY = "3D, alpha 1e-6 to 100"


class Case(NamedTuple):
    label: str
    """``part: name``, unique."""
    arguments: tuple
    expected: float | str
    """Largest error, or a regular expression of the sentence."""
    measure: str
    heavy: bool

    @property
    def marked(self):
        marks = [pytest.mark.lammps]
        if self.heavy or _HEAVY in self.label:
            marks.append(pytest.mark.validate)
        if self.label in KNOWN:
            reason, strict = KNOWN[self.label]
            marks.append(pytest.mark.xfail(reason=reason, strict=strict))
        return pytest.param(self, id=self.label, marks=marks)


def case(label, *arguments, expected=None, measure=None, heavy=False):
    return Case(label, arguments, expected, measure, heavy)


class Verdict(NamedTuple):
    measured: float | str
    holds: bool
    seconds: float


def judge(run, expected, *arguments):
    """Measure; NaN, a warning of NumPy, another error and a wrong sentence do not hold."""
    began = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            found = run(*arguments)
            measured = "no sentence" if found is None else float(found)
    except (ValueError, RuntimeError, RuntimeWarning) as error:
        measured = f"{error}" or type(error).__name__
    stopped = isinstance(measured, str)
    if isinstance(expected, str):
        holds = stopped and bool(re.search(expected, measured))
    else:
        holds = not stopped and bool(measured <= expected)
    return Verdict(measured, holds, time.perf_counter() - began)


def shown(value):
    return value if isinstance(value, str) else f"{value:.2g}"


def extreme(measure, cases, expected=None):
    """Make a test of a function that measures.

    Parameters
    ----------
    measure
        Description of the error, unless a case has its own.
    cases
        Labels, arguments and, where they differ from `expected`, bounds.
    expected
        Largest error, or a regular expression of the sentence with which the function must stop.
    """

    def named(one):
        assert one.label not in _LABELS, f"two cases are called {one.label!r}"
        _LABELS.add(one.label)
        bound = expected if one.expected is None else one.expected
        what = "sentence" if isinstance(bound, str) else one.measure or measure
        return one._replace(expected=bound, measure=what)

    def decorate(run):
        @pytest.mark.parametrize("case", [named(one).marked for one in cases])
        def test(case, table_row, measured, tmp_path):
            more = [tmp_path] if "tmp_path" in signature(run).parameters else []
            found = judge(run, case.expected, *case.arguments, *more)
            part, _, name = case.label.partition(": ")
            sign = "" if isinstance(case.expected, str) else "<= "
            table_row(part, {
                "case": name, "error or sentence of": case.measure,
                "expected": sign + shown(case.expected), "measured": shown(found.measured),
                "verdict": "holds" if found.holds else "**FAIL**", "s": f"{found.seconds:.2f}",
            })  # fmt: skip
            if not isinstance(found.measured, str):
                measured(error=found.measured)
            assert found.holds, f"{case.measure}: {found.measured}, expected {case.expected}"

        test.__name__, test.__module__ = run.__name__, run.__module__
        return test

    return decorate
