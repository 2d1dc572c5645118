"""Fixture `measured`: the worst numbers a test saw, printed after the run with `pytest -v`."""

from __future__ import annotations

import pytest

MEASURED = "measured"


@pytest.fixture
def measured(request):
    def record(**numbers):
        # A test's properties reach the summary from any process that ran it, in plain types.
        plain = {name: float(x) for name, x in numbers.items()}
        request.node.user_properties.append((MEASURED, plain))

    return record


def numbers_of(report):
    return {
        name: x for key, of in report.user_properties if key == MEASURED for name, x in of.items()
    }


def pytest_terminal_summary(terminalreporter, config):
    if config.get_verbosity() <= 0:
        return
    reports = [x for of in terminalreporter.stats.values() for x in of if hasattr(x, "when")]
    found = {x.nodeid: numbers_of(x) for x in reports if x.when == "call" and numbers_of(x)}
    if found:
        terminalreporter.section("measured")
    for name, numbers in found.items():
        values = "  ".join(f"{key} {value:.3g}" for key, value in numbers.items())
        terminalreporter.write_line(f"{name.rpartition('::')[2]}: {values}")
