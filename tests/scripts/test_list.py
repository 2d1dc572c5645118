"""The list of the analysis scripts, and what all of them have in common."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ANALYSIS = ROOT / "analysis"
SCRIPTS = sorted(
    path.relative_to(ANALYSIS).as_posix()
    for path in ANALYSIS.rglob("*.py")
    if '__name__ == "__main__"' in path.read_text()
)


def docstring(script):
    return ast.get_docstring(ast.parse((ANALYSIS / script).read_text()))


def listed():
    """Scripts with what the README says that they do, by their paths."""
    rows, folder = {}, ""
    for line in (ANALYSIS / "README.md").read_text().splitlines():
        if heading := re.match(r"## .*\(`(\w+)/`\)", line):
            folder = f"{heading[1]}/"
        elif line.startswith("## "):
            folder = ""
        if row := re.match(r"\| `([\w.]+)` \| (.*) \|$", line):
            rows[folder + row[1]] = row[2]
    return rows


def test_every_script_is_listed_and_no_other():
    assert sorted(listed()) == SCRIPTS


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_list_says_what_the_script_says(script):
    first = docstring(script).splitlines()[0].rstrip(".")
    # Of the figures of a paper, which stand under its name.
    short = re.sub(r" of (Marschall & Teitel|Yuan, VanderWerf|VanderWerf, Jin).*$", "", first)
    assert listed()[script] == short


@pytest.mark.parametrize("script", SCRIPTS)
def test_the_commands_of_a_docstring_name_the_script(script):
    commands = re.findall(r"python (analysis/\S+\.py)", docstring(script))
    assert f"analysis/{script}" in commands
    assert all((ROOT / command).exists() for command in commands)
