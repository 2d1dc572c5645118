"""Examples of the gallery are short, call functions as these are, and show each of them; notebooks hold no outputs.

The build of the site runs them all (./run docs), where an error in one ends it; here `-m validate` does.
"""

import ast
import contextlib
import inspect
import json
import re
from pathlib import Path

import pytest

import jamshape as js

DOCS = Path(__file__).parents[2] / "docs"
EXAMPLES = sorted((DOCS / "gallery").rglob("*.py"))
COURSE = sorted((DOCS / "course").glob("*.ipynb"))
LONGEST = 20  # lines of code without blank ones


def name_of(path):
    return path.relative_to(DOCS).as_posix()


def cells_of(notebook):
    return json.loads(notebook.read_text(encoding="utf-8"))["cells"]


def code_of(path):
    """Return the code of a script, or of all cells of a notebook."""
    if path.suffix == ".py":
        return path.read_text(encoding="utf-8")
    return "\n".join("".join(c["source"]) for c in cells_of(path) if c["cell_type"] == "code")


def public_calls(tree):
    """Yield the names of functions of jamshape that are called, with the names of keywords."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            owner = node.func.value
            if isinstance(owner, ast.Name) and owner.id == "js":
                yield node.func.attr, {k.arg for k in node.keywords if k.arg}


def test_there_are_examples_of_every_kind():
    assert len(EXAMPLES) >= 24
    assert len(COURSE) == 5


@pytest.mark.parametrize("path", EXAMPLES, ids=name_of)
def test_an_example_has_a_title_and_few_lines(path):
    tree = ast.parse(code_of(path))
    title, underline, *rest = ast.get_docstring(tree).split("\n")
    assert underline == "=" * len(title)
    assert "".join(rest).strip()  # says what is seen
    begins = tree.body[0].end_lineno
    lines = code_of(path).splitlines()[begins:]
    assert 5 <= len([line for line in lines if line.strip()]) <= LONGEST


@pytest.mark.parametrize("path", [*EXAMPLES, *COURSE], ids=name_of)
def test_functions_are_called_by_names_that_they_have(path):
    calls = list(public_calls(ast.parse(code_of(path))))
    assert calls or "jamshape" in code_of(path)  # or only its command
    for name, keywords in calls:
        signature = inspect.signature(getattr(js, name)).parameters.values()
        known = {one.name for one in signature}
        assert keywords <= known or any(p.kind == p.VAR_KEYWORD for p in signature), name


def test_every_public_function_is_shown_somewhere():
    shown = {
        name for path in [*EXAMPLES, *COURSE] for name, _ in public_calls(ast.parse(code_of(path)))
    }
    public = {name for name in dir(js) if name.islower() and inspect.isfunction(getattr(js, name))}
    assert len(public) > 20
    assert public - shown == set()


@pytest.mark.parametrize("path", COURSE, ids=name_of)
def test_a_notebook_has_no_outputs_and_exercises_with_solutions(path):
    cells = cells_of(path)
    assert not any(cell.get("outputs") for cell in cells)
    text = "\n".join("".join(c["source"]) for c in cells if c["cell_type"] == "markdown")
    exercises = len(re.findall(r"^\*\*\d\.\*\* ", text, re.MULTILINE))
    hidden = [c for c in cells if "hide-cell" in c["metadata"].get("tags", [])]
    assert 2 <= exercises <= 4
    assert exercises == len(hidden) == text.count("<summary>Solution</summary>")


@pytest.mark.validate
@pytest.mark.lammps
@pytest.mark.parametrize("path", EXAMPLES, ids=name_of)
def test_an_example_runs_and_draws(path, tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    import matplotlib.pyplot as plt  # noqa: PLC0415 - after its backend is chosen

    plt.close("all")
    with contextlib.chdir(tmp_path):
        exec(compile(code_of(path), path, "exec"), {"__name__": "__main__"})  # noqa: S102 - our own
    drawn = len(plt.get_fignums()) + len(list(tmp_path.glob("*.gif")))
    plt.close("all")
    assert drawn >= 1


@pytest.mark.validate
@pytest.mark.lammps
@pytest.mark.parametrize("path", COURSE, ids=name_of)
def test_a_notebook_runs(path, tmp_path):
    pytest.importorskip("ipykernel")
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    resources = {"metadata": {"path": str(tmp_path)}}
    notebook = nbformat.read(path, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, resources=resources).execute()
