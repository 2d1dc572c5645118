"""Tables of the rows that tests give: `pytest tests/extremes --report FILE.md`, with `-m ""` of all."""

import json
import platform

import pytest

ROW = "row"


class Tables:
    """Tables in Markdown; rows are kept beside the page, and tests skipped that have passed with a row there."""

    def __init__(self, page, is_worker=False):
        self.page, self.kept, self.is_worker = page, page.with_suffix(".jsonl"), is_worker
        lines = self.kept.read_text().splitlines() if self.kept.exists() else []
        self.rows = {row["test"]: row for row in map(json.loads, lines)}

    def pytest_runtest_setup(self, item):
        if self.rows.get(item.nodeid, {}).get("passed"):
            pytest.skip(f"its row is in {self.kept}")

    def pytest_runtest_logreport(self, report):
        own = dict(report.user_properties).get(ROW)
        if report.failed and own is None:  # as where the process of the test has ended
            own = (
                "without a row",
                {"test": report.nodeid, "end": str(report.longrepr).splitlines()[-1]},
            )
        if self.is_worker or own is None or not (report.failed or report.when == "call"):
            return
        row = {"test": report.nodeid, "passed": report.passed, "heading": own[0], "cells": own[1]}
        self.rows[report.nodeid] = row
        self.page.parent.mkdir(parents=True, exist_ok=True)
        with self.kept.open("a") as file:
            file.write(json.dumps(row) + "\n")

    def pytest_sessionfinish(self):
        if self.rows and not self.is_worker:
            self.page.write_text(self.text())

    def text(self):
        failed = [row for row in self.rows.values() if not row["passed"]]
        where = f"{platform.platform()}, Python {platform.python_version()}"
        lines = [f"{len(self.rows)} rows, {len(failed)} of which do not hold: {where}.", ""]
        tables = {f"fails, {row['heading']}": [] for row in failed}
        for row in failed:
            tables[f"fails, {row['heading']}"].append(row["cells"])
        for row in self.rows.values():
            tables.setdefault(row["heading"], []).append(row["cells"])
        for heading, rows in tables.items():
            lines += [f"## {heading[:1].upper()}{heading[1:]}", "", *table(rows), ""]
        return "\n".join(lines)


def table(rows):
    """Lines of Markdown."""

    def line(cells):
        return "| " + " | ".join(x.replace("|", "\\|").replace("\n", " ") for x in cells) + " |"

    return [line(rows[0]), line(["---"] * len(rows[0])), *(line(row.values()) for row in rows)]
