"""Whether a packing reached its goal, from the attributes of its file, with a warning if not.

The goal is force balance to the tolerance, possibly on a kink of the energy, and for a strict packing also no mode
with a negative eigenvalue. This is the only definition, used by all reports and averages.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from typing import Any

from jamshape.checks import NotReachedWarning
from jamshape.files.vocabulary import MINIMISED

AT_REST = ("converged", "kink")
"""Outcomes of minimisations after which forces balance."""

_UNJAMMED = "unjammed"
_SLIDING = "sliding"  # remaining forces lie along sliding modes; they may be below the tolerance

_ADVICE = "{strict}, another {u0:name} or another {seed:name}"
_ADVICE_OF_STRICT = "another {u0:name} or another {seed:name}"
_ADVICE_OF_DIGITS = "a larger {u0:name} or {tolerance:name}, since rounding leaves more"


def is_reached(known: Mapping[str, Any]) -> bool:
    """Return whether a packing reached its goal.

    Parameters
    ----------
    known : mapping of str to Any
        Attributes of its file.

    Examples
    --------
    >>> is_reached({"outcome": "kink"}), is_reached({"outcome": "stalled"})
    (True, False)
    >>> is_reached({"outcome": "sliding", "residual": 2e-7, "tolerance": 1e-8})
    False
    """
    return _is_balanced(known) and not _n_negative(known) and not _is_unstable(known)


def shortfall(known: Mapping[str, Any]) -> str:
    """Describe how a packing falls short of its goal; empty if it does not.

    Examples
    --------
    >>> shortfall({"outcome": "sliding", "residual": 2e-7, "tolerance": 1e-8})
    'it ended sliding, with net forces up to 2e-07 of the mean force of a bond, expected at most 1e-08'
    """
    if not _is_balanced(known):
        found = f"with net forces up to {_residual(known):.2g} of the mean force of a bond"
        most = f", expected at most {_tolerance(known):g}" if "tolerance" in known else ""
        return f"it ended {known['outcome']}, {found}{most}"
    if n := _n_negative(known):
        return f"{n} of its modes have a negative eigenvalue, expected none"
    if _is_unstable(known):
        value, bound = (known[f"bordered_eigenvalue{end}"] for end in ("", "_bound"))
        return f"after {known['tries']} tries the smallest eigenvalue of its bordered Hessian is {value:.2g} +- {bound:.1g}, expected none below 0"
    return ""


def warn_unless_reached(known: Mapping[str, Any], stacklevel: int = 2) -> None:
    """Warn if a packing did not reach its goal.

    Parameters
    ----------
    known : mapping of str to Any
        Attributes of its file.
    stacklevel : int
        See `warnings.warn`, counted from the caller.

    Warns
    -----
    NotReachedWarning
    """
    if found := shortfall(known):
        advice = _ADVICE_OF_STRICT if known.get("strict") else _ADVICE
        if known.get("rounding_floor", 0.0) > _tolerance(known):
            advice = _ADVICE_OF_DIGITS
        given = {"strict": True, "u0": None, "seed": None, "tolerance": None}
        said = NotReachedWarning(f"the packing is not at rest: {found}; try {advice}", given)
        warnings.warn(said, stacklevel=stacklevel + 1)


def _is_balanced(known: Mapping[str, Any]) -> bool:
    outcome = known["outcome"]
    if outcome == _UNJAMMED and (known.get("protocol") == MINIMISED or "target_phi" in known):
        return True  # nothing touches, so that forces vanish
    return outcome in AT_REST or (outcome == _SLIDING and _residual(known) <= _tolerance(known))


def _n_negative(known: Mapping[str, Any]) -> int:
    return int(known.get("n_negative", 0)) if known.get("strict") else 0


def _is_unstable(known: Mapping[str, Any]) -> bool:
    """Return whether a packing that was to be stable to shear is not."""
    bound = float(known.get("bordered_eigenvalue_bound", 0.0))
    return bool(known.get("stable_to_shear")) and float(known["bordered_eigenvalue"]) < -bound


def _residual(known: Mapping[str, Any]) -> float:
    """Return the largest net force or torque; NaN if unknown."""
    if "residual" in known:
        return float(known["residual"])
    return max(float(known.get(f"residual_{name}", math.nan)) for name in ("force", "torque"))


def _tolerance(known: Mapping[str, Any]) -> float:
    """Return the tolerance of force balance; NaN if unknown, which no residual is below."""
    return float(known.get("tolerance", known.get("quasistatic_tolerance", math.nan)))
