"""Every public name of the front door, and of what stands behind it, has an example, and all of them run."""

import ast
import doctest
import importlib
import inspect
import re
from pathlib import Path

import pytest

import jamshape

# What examples need that may not be installed.
TOOLS = {
    "jamshape.exchange.gsd": "gsd",
    "jamshape.exchange.freud": "freud",
    "jamshape.exchange.ovito": "ovito",
    "jamshape.exchange.mdanalysis": "MDAnalysis",
}

FOLDER = Path(jamshape.__file__).parent
COMMON = Path(__file__).parents[3] / "analysis" / "common"
# Which minimum it is depends on every step to it: examples leave out ("...") what is its own.
LIKE_HERE = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
EXAMPLE = re.compile(r"^ *>>> ", re.MULTILINE)


def with_examples():
    """All modules that have one."""
    for folder in (FOLDER, COMMON):
        for file in sorted(folder.rglob("*.py")):
            if EXAMPLE.search(file.read_text()):
                parts = file.relative_to(folder.parent).with_suffix("").parts
                yield ".".join(parts).removesuffix(".__init__")


@pytest.fixture(scope="module")
def in_a_folder(tmp_path_factory):
    """A working directory that all examples share: one makes a packing, others load it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("examples"))
        patch.setenv("MPLBACKEND", "agg")
        yield


@pytest.mark.parametrize("name", with_examples())
@pytest.mark.usefixtures("in_a_folder")
def test_examples_run(name):
    if name in TOOLS:
        pytest.importorskip(TOOLS[name])
    found = doctest.testmod(importlib.import_module(name), optionflags=LIKE_HERE)
    assert found.attempted
    assert not found.failed


def public():
    stub = ast.parse((FOLDER / "__init__.pyi").read_text())
    return [a.name for node in stub.body if isinstance(node, ast.ImportFrom) for a in node.names]


def test_the_list_of_names_is_what_is_there():
    assert sorted(public()) == sorted(jamshape.__all__)


@pytest.mark.parametrize("name", public())
def test_every_public_name_is_told_with_an_example(name):
    text = inspect.getdoc(getattr(jamshape, name))
    assert ">>> " in text
