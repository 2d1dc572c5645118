"""Settings that a deck was given with -var, before anything runs: names that it does not know, and values that are none.

The ranges are those in which jamshape was tried, as the library has them; it takes too long to start to be asked.
"""

from __future__ import annotations

import math
import re
from itertools import pairwise

from jamshape.lammps.deck.asking import Deck, Refused

NUMBER = r"[+-]?(?:[0-9]+[.]?[0-9]*|[.][0-9]+)(?:[eE][+-]?[0-9]+)?"

# The least and the largest number, and what else it may be; whole numbers are written without a point.
WHOLE = {
    "n": (1, 10**7),
    "seed": (1, 2**31 - 1),
    "rows": (1, 10**6),
    "frames": (1, 10**6),
    "maxiter": (1, 10**7),
}
RANGES: dict[str, tuple[float, ...]] = {
    "alpha": (1e-6, 100.0, 0.0),
    "p": (0.55, 10.0),
    "w1": (0.1, 1.0),
    "w2": (1.0, 10.0),
    "kappa": (1e-14, 0.1),
    "gdot": (1e-14, 0.1),
    "strain": (1e-6, 1e6),
    "dt": (1e-6, 10.0),
    "phi_start": (1e-9, 0.999),
    "phi_end": (1e-6, 2.0),
    "p_end": (1e-12, 1.0),
    "k_e": (1e-12, 1e12),
    "epsilon": (1e-12, 1e12),
}
WORDS = {
    "sides": ("one|two", "one or two"),
    "integrator": (
        f"heun|(heun/adaptive|rkc2)( tolerance {NUMBER})?",
        "heun, heun/adaptive or rkc2, the last two with tolerance NUMBER",
    ),
}
PATHS = ("out", "data", "restart")
_MOST_STEPS = 10**12
_LARGEST_DECK = 10**6


def require_settings(deck: Deck) -> dict[str, str]:
    """Values of the settings that the deck has.

    Raises
    ------
    Refused
        One sentence about the first that is none.
    """
    found = {name: deck.ask(name) for name in (*WORDS, *WHOLE, *RANGES, *PATHS)}
    value = {name: text for name, text in found.items() if text is not None}
    wrong = _wrong_name(deck)
    for name, text in value.items():
        wrong = wrong or wrong_value(name, text)
    wrong = wrong or wrong_run(value)
    if wrong:
        raise Refused(wrong)
    return value


def known_settings(text: str) -> list[str]:
    r"""Names that a deck lists at its top or asks for.

    Examples
    --------
    >>> known_settings("variable kappa index 1e-4\nvariable have equal is_defined(variable,data)")
    ['kappa', 'data']
    """
    listed = re.findall(r"^variable +([^ ]+) +index", text, re.MULTILINE)
    asked = re.findall(r"is_defined[(]variable,([^ )]+)", text)
    return listed + [name for name in asked if not name.startswith("jamshape")]  # of the loader


def _wrong_name(deck: Deck) -> str | None:
    words = deck.arguments()
    given = [name for option, name in pairwise(words) if option in {"-var", "-v"}]
    small = (path for path in deck.open_files() if path.stat().st_size < _LARGEST_DECK)
    texts = [path.read_text(errors="replace") for path in small] if given else []
    known = known_settings("\n".join(text for text in texts if "variable out " in text))
    for name in given if known else []:
        if name not in known and not name.startswith("jamshape"):
            import difflib  # noqa: PLC0415 - slow

            meant = difflib.get_close_matches(name, known, 1) or [", ".join(known)]
            return f"The deck has no setting {name}, expected {meant[0]}: correct -var {name}."
    return None


def wrong_value(name: str, value: str) -> str | None:
    """Say what is wrong with a value, if anything.

    Examples
    --------
    >>> wrong_value("n", "0")
    "n is '0', expected a whole number from 1 to 10000000."
    """
    expected = None
    if name in WORDS and not re.fullmatch(WORDS[name][0], value):
        expected = f"{WORDS[name][1]}."
    elif name in WHOLE:
        low, high = WHOLE[name]
        if not (re.fullmatch("[0-9]{1,12}", value) and low <= int(value) <= high):
            expected = f"a whole number from {low} to {high}."
    elif name in RANGES:
        least, largest, *also = RANGES[name]
        is_number = re.fullmatch(NUMBER, value)
        if not (is_number and (least <= float(value) <= largest or float(value) in also)):
            other = "".join(f"{number:g} or " for number in also)
            expected = f"{other}a number from {least:g} to {largest:g}."
    elif name in PATHS and (not value.strip() or not value.isprintable()):
        expected = "a path without control characters: choose another name."
    return f"{name} is {value!r}, expected {expected}" if expected else None


def wrong_run(value: dict[str, str]) -> str | None:
    """Say what is wrong with a compression that does not compress, or a run that does not end."""
    if {"strain", "gdot", "dt"} <= value.keys():
        strain, gdot, dt = (float(value[name]) for name in ("strain", "gdot", "dt"))
        if strain > _MOST_STEPS * gdot * dt:
            return (
                f"gdot = {gdot:g} and dt = {dt:g} take more than {_MOST_STEPS:g} steps, "
                "expected a larger rate or time step."
            )
    if not {"phi_start", "phi_end", "kappa", "dt"} <= value.keys():
        return None
    start, end, kappa, dt = (float(value[name]) for name in ("phi_start", "phi_end", "kappa", "dt"))
    if not start < end:
        return f"phi_start is {start:g} and phi_end {end:g}, expected an end above the start."
    if math.log(end / start) > _MOST_STEPS * 2 * kappa * dt:
        return (
            f"kappa = {kappa:g} and dt = {dt:g} take more than {_MOST_STEPS:g} steps, "
            "expected a larger rate or time step."
        )
    return None
