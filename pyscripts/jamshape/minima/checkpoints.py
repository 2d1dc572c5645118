"""Minima and searches as plain numbers and arrays, for checkpoints."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

from jamshape.landscape import Evaluation
from jamshape.minima.descent import History, Minimum, Outcome, Residual
from jamshape.minima.target import Leading, Search

_MINIMA = "start", "jammed", "best", "unfinished"  # of `Leading`


def told_minimum(minimum: Minimum | None) -> dict[str, Any] | None:
    """Return a minimum without its history; None for None."""
    if minimum is None:
        return None
    return {
        "state": minimum.state,
        "evaluation": minimum.evaluation._asdict(),
        "outcome": minimum.outcome.value,
        "residual": minimum.residual._asdict(),
    }


def minimum_of(told: Mapping[str, Any] | None, history: History) -> Minimum | None:
    """Return a minimum with its history."""
    if told is None:
        return None
    evaluation, residual = Evaluation(**told["evaluation"]), Residual(**told["residual"])
    return Minimum(told["state"], evaluation, Outcome(told["outcome"]), residual, history)


def told_search(search: Search) -> dict[str, Any]:
    """Return a search for an energy without its history."""
    found = {field.name: getattr(search, field.name) for field in dataclasses.fields(search)}
    del found["history"]
    if search.leading:
        leading = vars(search.leading)
        minima = {name: told_minimum(leading[name]) for name in _MINIMA}
        found["leading"] = leading | minima
    return found | {"minimum": told_minimum(search.minimum)}


def search_of(told: Mapping[str, Any], history: History) -> Search:
    """Return a search with its history."""
    found = dict(told) | {"minimum": minimum_of(told.get("minimum"), history), "history": history}
    if leading := told.get("leading"):
        minima = {name: minimum_of(leading.get(name), history) for name in _MINIMA}
        found["leading"] = Leading(**leading | minima)
    return Search(**found)
