"""Options of a command, from the signature and the docstring of a public function.

An argument becomes the option of its name, or a position if it has no default, with the type of its annotation, the
default of the signature, and the choices and the text of the docstring. A pair such as ``phi`` becomes ``--phi-start`` and ``--phi-end``, with the parts
of its text before and after ", and "; ``particles`` becomes the options of particles, and ``file`` becomes ``--out``. With an
argument that `front.reading.packing_of` reads come ``--frame``, ``--dimension`` and ``--shape``, as of `load`.
"""

from __future__ import annotations

import ast
import inspect
import re
import types
import typing
from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from jamshape.checks import TIME_IS_UP, require_with
from jamshape.command import parser_of, typed
from jamshape.front.reading import packing_of
from jamshape.old_names import VALUES, add_old_option, current
from jamshape.packing import Packing
from jamshape.shapes.command_line import (
    add_meaning_options,
    add_particle_options,
    are_particles_given,
    particles_beside,
    particles_of,
)

_STOP = f"stop at the first checkpoint after this time [s], with exit code {TIME_IS_UP}; the same command resumes"

# Arguments that are alike for every command; progress is always shown.
_ALIKE: dict[str, Any] = {
    "file": {"type": Path, "required": True, "help": "H5MD file to write"},
    "again": {"action": "store_true", "help": "start over if --out exists"},
    "seconds": {"type": float, "help": _STOP},
}
_DESTS = {"file": "out"}
_PARTICLES = "particles"
_LEFT_OUT = {_PARTICLES, "progress"}


class _Option(NamedTuple):
    dest: str
    usual: Any
    """Default, or `inspect.Parameter.empty`."""
    keywords: dict[str, Any]

    @property
    def flag(self) -> str:
        """Its name on the command line; that of a position if there is no default."""
        return self.dest if self.usual is inspect.Parameter.empty else _flag(self.dest)


def parser_for(function: Callable[..., Any], doc: str | None) -> ArgumentParser:
    """Make the parser of a command that calls a function, with a docstring as its help.

    Options that were not typed are None: the function knows the defaults, and absent options cannot contradict
    anything. Old names of arguments become old options.
    """
    parser = parser_of(doc)
    if _PARTICLES in inspect.signature(function).parameters:
        add_particle_options(parser)
    old = {new: name for name, new in getattr(function, "old_names", {}).items()}
    for name, options in _options(function).items():
        for one in options:
            parser.add_argument(one.flag, **one.keywords, default=None)
        if name in old:
            keywords = {key: options[0].keywords[key] for key in ("type", "choices")}
            add_old_option(parser, _flag(old[name]), _flag(name), **keywords)
    if _held(function) is not None:
        parser.add_argument(
            "--frame", type=int, help="frame of that file; negative counts from the end (-1)"
        )
        if missing := _meaning_only(function):
            add_meaning_options(parser, *missing)
    return parser


def given(function: Callable[..., Any], options: Namespace) -> dict[str, Any]:
    """Return the arguments that were typed, without particles; half of a pair is completed by its default."""
    found = {}
    for name, parts in _options(function).items():
        values = [getattr(options, one.dest) for one in parts]
        if any(value is not None for value in values):
            pairs = zip(values, parts, strict=True)
            whole = tuple(one.usual if value is None else value for value, one in pairs)
            found[name] = whole if len(whole) > 1 else whole[0]
    return found


def called(function: Callable[..., Any], options: Namespace, **more: Any) -> Any:
    """Call a function with the particles and arguments that were typed, and more."""
    arguments = given(function, options) | more
    options = _with_packing(function, options, arguments)
    known = inspect.signature(function).parameters.get(_PARTICLES)
    if known is not None:
        read = particles_of if known.default is known.empty else particles_beside
        arguments[_PARTICLES] = read(options)
    return function(**arguments)


def _held(function: Callable[..., Any]) -> str | None:
    """Name the argument that is a packing, or a file of one."""
    parameters = inspect.signature(function, eval_str=True).parameters
    return next((n for n, one in parameters.items() if Packing in _kinds(one.annotation)), None)


def _meaning_only(function: Callable[..., Any]) -> list[str]:
    """List the options of `add_meaning_options` that mean nothing else to a command."""
    own, others = inspect.signature(function).parameters, {"shape": _PARTICLES}
    return [name for name in ("dimension", "shape") if others.get(name, name) not in own]


def _with_packing(
    function: Callable[..., Any], options: Namespace, arguments: dict[str, Any]
) -> Namespace:
    """Read the packing of a frame or a meaning that was typed into the arguments; return the options left."""
    name = _held(function)
    if name is None:
        return options
    path = arguments.get(name)
    require_with(name, path, **typed(options, "frame", *_meaning_only(function)))
    meaning = typed(options, "frame", "dimension", "shape")
    others = Namespace(**vars(options) | {"shape": None})
    is_mixed = "shape" not in _meaning_only(function) and are_particles_given(others)
    if path is None or not meaning or is_mixed:
        return options
    arguments.pop("dimension", None)
    arguments[name] = packing_of(path, **meaning)
    return others


def _options(function: Callable[..., Any]) -> dict[str, list[_Option]]:
    """List the options of each argument of a function: one, or two of a pair."""
    told, found = _told(function), {}
    for name, parameter in inspect.signature(function, eval_str=True).parameters.items():
        if name in _ALIKE:
            found[name] = [_Option(_DESTS.get(name, name), None, _ALIKE[name])]
        elif name not in _LEFT_OUT:
            kind, is_pair = _kind(parameter.annotation)
            known, text = told.get(name, ("", ""))  # nothing is known under python -OO
            dests = [f"{name}_start", f"{name}_end"] if is_pair else [name]
            usual = parameter.default if is_pair else [parameter.default]
            texts = text.partition(", and ")[::2] if is_pair else [text]
            keywords = _keywords(name, kind, known)
            if _is_several(parameter.annotation):
                keywords["nargs"] = "+"
            if parameter.default is parameter.empty:
                keywords["metavar"] = name.upper()
            found[name] = [
                _Option(dest, value, keywords | {"help": _help(part, value, told)})
                for dest, value, part in zip(dests, usual, texts, strict=True)
            ]
    return found


def _kind(annotation: Any) -> tuple[type, bool]:
    """Return the type of an option, and whether there are two."""
    kinds = _kinds(annotation)
    if _is_several(annotation):
        return _kind(typing.get_args(kinds[0])[0])
    for kind in kinds:
        if typing.get_origin(kind) is tuple:
            return _kind(typing.get_args(kind)[-1])[0], True
    return next(kind for kind in (Path, str, float, int, bool) if kind in kinds), False


def _kinds(annotation: Any) -> Sequence[Any]:
    """Return the types of an annotation."""
    return typing.get_args(annotation) if isinstance(annotation, types.UnionType) else [annotation]


def _is_several(annotation: Any) -> bool:
    """Whether an option takes one value or more."""
    return typing.get_origin(_kinds(annotation)[0]) is Sequence


def _keywords(name: str, kind: type, known: str) -> dict[str, Any]:
    """Return keywords of `add_argument`; braces in the type of a docstring list choices."""
    if kind is bool:
        return {"action": "store_true"}
    listed = re.search(r"\{(.*)\}", known)
    choices = [kind(one) for one in ast.literal_eval(f"[{listed[1]}]")] if listed else None
    return {"type": partial(current, name) if name in VALUES else kind, "choices": choices}


def _told(function: Callable[..., Any]) -> dict[str, tuple[str, str]]:
    """Read the type and the text of each argument from the docstring."""
    doc = inspect.getdoc(function) or ""
    section = doc.partition("Parameters\n----------\n")[2].partition("\n\n")[0]
    entries = re.findall(r"^(\w+) : (.*)((?:\n    .*)*)", section, re.MULTILINE)
    return {name: (known, " ".join(text.split())) for name, known, text in entries}


def _help(text: str, default: Any, told: dict[str, Any]) -> str:
    """Format a text of a docstring as help: options for arguments, no markup, no capital, and the default."""
    text = re.sub(r"`(\w+)`", lambda one: _flag(one[1]) if one[1] in told else one[1], text)
    text = text.replace("`", "").removesuffix(".").replace("%", "%%")
    if text[1:2].islower():
        text = text[0].lower() + text[1:]
    if any(default is one for one in (None, False, inspect.Parameter.empty)):
        return text
    first, dot, rest = text.partition(". ")
    return f"{first} ({default}){dot}{rest}"


def _flag(name: str) -> str:
    return f"--{name.replace('_', '-')}"
