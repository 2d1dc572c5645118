"""Fixture `measured`: the worst numbers a test saw, printed after the run with `pytest -v`."""

from __future__ import annotations

import pytest

MEASURED = pytest.StashKey[dict]()


def pytest_configure(config):
    config.stash[MEASURED] = {}


@pytest.fixture
def measured(request):
    def record(**numbers):
        request.config.stash[MEASURED].setdefault(request.node.name, {}).update(numbers)

    return record


def pytest_terminal_summary(terminalreporter, config):
    if config.get_verbosity() > 0 and config.stash.get(MEASURED, {}):
        terminalreporter.section("measured")
        for name, numbers in config.stash[MEASURED].items():
            values = "  ".join(f"{key} {value:.3g}" for key, value in numbers.items())
            terminalreporter.write_line(f"{name}: {values}")
