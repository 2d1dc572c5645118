"""Fixtures for what tests measure: numbers after the run with `pytest -v`, tables with `--report FILE.md`."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest
from tables import ROW, Tables

MEASURED = "measured"

# A shell's background ignores Ctrl-C, and so would all processes that tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


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


# --- tables --------------------------------------------------------------------------------------


@pytest.fixture
def table_row(request):
    """Give the row of this test, cells by column, for the table of this heading."""

    def record(heading, cells):
        request.node.user_properties.append((ROW, (heading, cells)))

    return record


def pytest_addoption(parser):
    parser.addoption(
        "--report", metavar="FILE.md", type=Path, help="write the tables of tests that have rows"
    )


def pytest_configure(config):
    if page := config.getoption("--report"):
        config.pluginmanager.register(Tables(page, is_worker=hasattr(config, "workerinput")))
