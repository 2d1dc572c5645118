"""The stub of the compiled module names what the module has, no more and no less."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

import pytest

import jamshape
from jamshape import _contact
from jamshape.shapes.table import SHAPES

STUB = ast.parse(Path(jamshape.__file__).with_name("_contact.pyi").read_text(encoding="utf-8"))
CLASSES = {x.name: x for x in STUB.body if isinstance(x, ast.ClassDef)}
FUNCTIONS = {x.name: x for x in STUB.body if isinstance(x, ast.FunctionDef)}
NAMES = {x.target.id for x in STUB.body if isinstance(x, ast.AnnAssign)}
CONSTANTS = {name for name in NAMES if not name.startswith("_")}
OPEN = {name: x for name, x in CLASSES.items() if not name.startswith("_")}
OPEN |= {shape.compiled_name: CLASSES["_Shape"] for shape in SHAPES.values()}


def members(stub):
    """Members of a class with inherited ones: name to definition."""
    found = {}
    for base in stub.bases:
        found |= members(CLASSES[base.id])
    for x in stub.body:
        if isinstance(x, ast.FunctionDef):  # with its overloads
            found[x.name] = [*(found.get(x.name, []) if x.decorator_list else []), x]
        elif isinstance(x, ast.AnnAssign):
            found[x.target.id] = x
    return found


def arguments_of_stub(function):
    """Names, and whether they have a default."""
    plain = [x.arg for x in function.args.args]
    n_required = len(plain) - len(function.args.defaults)
    return [(name, k >= n_required) for k, name in enumerate(plain)]


def arguments_of(compiled, overload=0):
    signature = compiled.__nb_signature__[overload][0]
    inside = re.fullmatch(r"def \w+\((.*)\) -> .*", signature, re.DOTALL).group(1)
    names = re.findall(r"(?:^|, )(\w+)(?:: ((?:\[[^\]]*\]|[^,\[])*))?", strip_brackets(inside))
    return [(name, "=" in kind) for name, kind in names]


def strip_brackets(text):
    """Without what stands in brackets, of types."""
    while (shorter := re.sub(r"\[[^\[\]]*\]", "", text)) != text:
        text = shorter
    return text


def test_the_module_has_what_the_stub_names():
    names = {name for name in vars(_contact) if not name.startswith("_")}
    assert names == set(OPEN) | set(FUNCTIONS) | CONSTANTS


@pytest.mark.parametrize("name", sorted(FUNCTIONS))
def test_a_function_takes_what_the_stub_says(name):
    assert arguments_of(getattr(_contact, name)) == arguments_of_stub(FUNCTIONS[name])


@pytest.mark.parametrize("name", sorted(OPEN))
def test_a_class_has_the_members_of_the_stub(name):
    compiled, stub = getattr(_contact, name), members(OPEN[name])
    has = {x for x in vars(compiled) if not x.startswith("_")}
    assert has == {x for x in stub if not x.startswith("_")}
    for member, definition in stub.items():
        if isinstance(definition, list):
            has = getattr(compiled, member)
            assert len(getattr(has, "__nb_signature__", [0])) == len(definition), member
            for k, one in enumerate(definition):
                assert arguments_of(has, k) == arguments_of_stub(one)
        else:
            assert not inspect.isroutine(inspect.getattr_static(compiled, member))
