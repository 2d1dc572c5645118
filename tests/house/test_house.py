"""The rules of the house that no linter knows: shape is one place, functions are short, scripts stand alone."""

import ast
import re
from functools import cache
from pathlib import Path
from statistics import median, quantiles

import pytest
from stubs import stubs

from jamshape.shapes.table import SHAPES

ROOT = Path(__file__).parents[2]
LIBRARY, PLUGIN, ANALYSIS = ROOT / "pyscripts", ROOT / "lammps_plugin", ROOT / "analysis"

# Python that scripts share, and that keeps the library's rules.
SHARED = (LIBRARY, ANALYSIS / "common", ANALYSIS / "methods")

NAMES = re.compile("|".join(SHAPES), re.IGNORECASE)

# The places that may know which shapes there are.
OF_A_SHAPE = re.compile(
    rf"jamshape/shapes/|contact/({'|'.join(SHAPES)})/|/pair_({'|'.join(SHAPES)})_"
    r"|(contact/shapes\.hpp|bindings/probes\.cpp)$"
)

LONGEST, MOST_PARAMETERS = 60, 5


@cache
def tree_of(path):
    return ast.parse(path.read_text(encoding="utf-8"))


def python_files(*folders):
    return sorted(path for folder in folders for path in folder.rglob("*.py"))


def docstrings(tree):
    owners = (ast.Module, ast.ClassDef, ast.FunctionDef)
    for node in ast.walk(tree):
        if isinstance(node, owners) and ast.get_docstring(node, clean=False) is not None:
            yield id(node.body[0].value)
        # Texts behind fields describe them.
        for statement in getattr(node, "body", []) if isinstance(node, ast.ClassDef) else []:
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                yield id(statement.value)


def words_of_python(path):
    """Names and texts of the code, without comments and docstrings."""
    tree = tree_of(path)
    described = set(docstrings(tree))
    for node in ast.walk(tree):
        is_text = isinstance(node, ast.Constant) and isinstance(node.value, str)
        if is_text and id(node) not in described:
            yield node.value
        for field in ("id", "attr", "name", "arg", "module"):
            if isinstance(value := getattr(node, field, None), str):
                yield value


def words_of_cpp(path):
    code = re.sub(r"//[^\n]*|/\*.*?\*/", "", path.read_text(encoding="utf-8"), flags=re.DOTALL)
    return code.split()


def knowing(paths, words_of):
    return [
        path.relative_to(ROOT)
        for path in paths
        if not OF_A_SHAPE.search(path.as_posix()) and any(map(NAMES.search, words_of(path)))
    ]


def test_no_file_outside_the_places_of_shapes_knows_which_there_are(measured):
    sources = list(sorted(PLUGIN.rglob("*.*pp")) + sorted(PLUGIN.rglob("*.h")))
    found = knowing(python_files(*SHARED), words_of_python) + knowing(sources, words_of_cpp)
    measured(files_that_know_a_shape=len(found))
    assert found == []


@pytest.mark.parametrize(("path", "text"), stubs().items(), ids=["names", "functions"])
def test_stubs_are_those_of_the_table_of_shapes(path, text):
    assert path.read_text(encoding="utf-8") == text, "run tests/house/stubs.py"


def functions(*folders):
    for path in python_files(*folders):
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                yield f"{path.relative_to(ROOT)}:{node.name}", node


def parameters(node):
    a = node.args
    return [x.arg for x in (*a.posonlyargs, *a.args, *a.kwonlyargs) if x.arg not in {"self", "cls"}]


def positional(node):
    return [x.arg for x in node.args.args if x.arg not in {"self", "cls"}]


def lines(node):
    """Count the lines of a function, its docstring included."""
    return node.end_lineno - node.lineno + 1


def is_front_door(name):
    """Whether it is called with keywords that are all spelled out and told in a long docstring."""
    return "/jamshape/front/" in name and not name.rpartition(":")[2].startswith("_")


def test_functions_are_short(measured):
    lengths = {
        name: lines(n) for name, n in functions(LIBRARY, ANALYSIS) if not is_front_door(name)
    }
    values = list(lengths.values())
    measured(median_lines=median(values), p90_lines=quantiles(values, n=10)[-1])
    assert {name: n for name, n in lengths.items() if n > LONGEST} == {}


def test_the_front_door_does_little_itself():
    door = {name: n for name, n in functions(LIBRARY) if is_front_door(name)}
    own = {name: lines(n) - lines(n.body[0]) - len(parameters(n)) for name, n in door.items()}
    assert len(own) > 20
    assert {name: n for name, n in own.items() if n > LONGEST / 2} == {}


def test_functions_have_few_parameters():
    every = functions(LIBRARY, ANALYSIS)
    found = {name: parameters(node) for name, node in every if not is_front_door(name)}
    assert {name: p for name, p in found.items() if len(p) > MOST_PARAMETERS} == {}
    door = {name: positional(n) for name, n in functions(LIBRARY) if is_front_door(name)}
    assert {name: p for name, p in door.items() if len(p) > 3} == {}


# The head of a function in C++ as clang-format leaves it, up to the brace that opens its body.
CPP_HEAD = re.compile(
    r"^(?P<margin> *)(?!else|if|for|while|switch|catch|do|struct|class|namespace|enum|union|return)"
    r"[\w:~&*<>,\[\] ]*?(?P<name>[\w:~]+)\((?P<inside>[^;{}]*)\)[^;{}()]*(?::[^;]*?)?\{",
    re.MULTILINE,
)


def closed(text, at):
    """Find the end of the body that was opened before a place."""
    depth = 1
    for brace in re.compile("[{}]").finditer(text, at):
        depth += 1 if brace[0] == "{" else -1
        if not depth:
            return brace.end()
    return at


def cpp_functions():
    """Yield the place of each function in C++, its lines and its parameters."""
    for path in sorted((ROOT / "lammps_plugin").rglob("*.[ch]*")):
        text = path.read_text(encoding="utf-8")
        for head in CPP_HEAD.finditer(text) if path.suffix in {".cpp", ".hpp", ".h"} else ():
            body = text[head.start() : closed(text, head.end())]
            inside = re.sub(r"<[^<>]*>|\([^()]*\)", "", head["inside"]).partition(")")[0]
            place = f"{path.relative_to(ROOT)}:{text.count(chr(10), 0, head.start()) + 1}"
            yield place, body.count("\n") + 1, inside.count(",") + bool(inside.strip())


def test_functions_in_cpp_are_short_and_have_few_parameters(measured):
    every = list(cpp_functions())
    measured(functions=len(every), longest=max(lines for _, lines, _ in every))
    assert len(every) > 800
    assert [place for place, lines, _ in every if lines > LONGEST] == []
    assert [place for place, _, count in every if count > MOST_PARAMETERS + 1] == []


def imported(path):
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def is_script(path):
    return '__name__ == "__main__"' in path.read_text(encoding="utf-8")


SCRIPTS = [p for p in (*python_files(ANALYSIS), *LIBRARY.glob("*.py")) if is_script(p)]


@pytest.mark.parametrize("path", python_files(ANALYSIS), ids=lambda p: p.stem)
def test_no_script_is_imported_and_none_knows_the_compiled_module(path):
    names = set(imported(path))
    assert not names & {script.stem for script in SCRIPTS}
    assert not any("_contact" in name.split(".") for name in names)
