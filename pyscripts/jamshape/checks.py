"""Checks of numbers, names and paths from options, files and Python.

Messages are one sentence: what was found, what was expected. Needs only the standard library.
"""

from __future__ import annotations

import math
import numbers
import os
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

TIME_IS_UP = 75
"""Exit code of commands that stopped before their end (EX_TEMPFAIL)."""


class Range(NamedTuple):
    """Allowed values of a setting."""

    low: float
    high: float
    meaning: str = "a number"
    also: tuple[float, ...] = ()
    """Further values, such as 0."""
    whole: bool = False
    """Whether it is an integer."""


class _Typed(NamedTuple):
    """An argument in a message."""

    name: str
    value: Any
    is_option: bool

    def __format__(self, spec: str) -> str:
        """Format with the value, or with the spec ``name`` without; true options need no value."""
        if self.is_option:
            option = f"--{_OPTIONS.get(self.name, self.name).replace('_', '-')}"
            # A packing that a command has read was typed as its file.
            value = getattr(self.value, "file", None) or self.value
            return option if spec == "name" or value is True else f"{option} {value}"
        value = str(self.value) if isinstance(self.value, Path) else self.value
        return self.name if spec == "name" else f"{self.name}={_shown(value)}"


# Arguments whose options have another name.
_OPTIONS = {"file": "out"}


class Sentence(Exception):  # noqa: N818 - warnings are of this kind as well
    """Message of an exception or a warning that names arguments as they were typed.

    Parameters
    ----------
    template : str
        Text with ``{name}`` for an argument with its value and ``{name:name}`` for its name.
    given : mapping of str to Any
        Values of the arguments.
    """

    def __init__(self, template: str, given: Mapping[str, Any]) -> None:
        super().__init__(template, given)
        self.template, self.given = template, dict(given)

    def __str__(self) -> str:
        return self._written(is_option=False)

    @property
    def with_options(self) -> str:
        """The message for a command line."""
        return self._written(is_option=True)

    def _written(self, *, is_option: bool) -> str:
        typed = {name: _Typed(name, value, is_option) for name, value in self.given.items()}
        return self.template.format_map(typed)


class ArgumentError(Sentence, ValueError):
    """Arguments that contradict each other, or have no effect; parameters as in `Sentence`.

    Examples
    --------
    >>> error = ArgumentError("{phi} has no effect with {start}", {"phi": 0.7, "start": "run.h5"})
    >>> print(error)
    phi=0.7 has no effect with start='run.h5'
    >>> print(error.with_options)
    --phi 0.7 has no effect with --start run.h5
    """


class TimeLimitError(RuntimeError):
    """A run was stopped at a checkpoint because its time was up; the same call resumes it.

    A command that raises it exits with code `TIME_IS_UP`.
    """


class NotReachedWarning(Sentence, UserWarning):
    """A result that did not reach its goal: state and advice; parameters as in `Sentence`.

    A command that issues it exits with code 1.

    Examples
    --------
    >>> said = NotReachedWarning("forces do not balance; try {strict} or another {u0:name}", {"strict": True, "u0": None})
    >>> print(said)
    forces do not balance; try strict=True or another u0
    >>> print(said.with_options)
    forces do not balance; try --strict or another --u0
    """


def require_no_effect(beside: str, value: Any, **given: Any) -> None:
    """Refuse arguments that have no effect beside another one.

    Parameters
    ----------
    beside : str
        Name of the other one.
    value : Any
        Its value; None disables the check.
    **given
        The arguments, None where not given.

    Raises
    ------
    ArgumentError

    Examples
    --------
    >>> require_no_effect("start", "run.h5", n=None, phi=0.7)
    Traceback (most recent call last):
    jamshape.checks.ArgumentError: phi=0.7 has no effect with start='run.h5', expected one of them; leave the other out
    """
    for name, other in given.items():
        if value is not None and other is not None:
            template = f"{{{name}}} has no effect with {{{beside}}}, expected one of them; leave the other out"
            raise ArgumentError(template, {name: other, beside: value})


def require_with(needed: str, value: Any, **given: Any) -> None:
    """Refuse arguments that have no effect without another one; parameters as in `require_no_effect`.

    Raises
    ------
    ArgumentError

    Examples
    --------
    >>> require_with("u0", None, accuracy=1e-9)
    Traceback (most recent call last):
    jamshape.checks.ArgumentError: accuracy=1e-09 has no effect without u0, expected both or neither
    """
    for name, other in given.items():
        if value is None and other is not None:
            template = (
                f"{{{name}}} has no effect without {{{needed}:name}}, expected both or neither"
            )
            raise ArgumentError(template, {name: other, needed: value})


_COUNT = 1_000_000

RANGES = {
    "n": Range(1, 10_000_000, "particles", whole=True),
    "seed": Range(0, 2**63 - 1, "a seed", whole=True),
    "rows": Range(1, _COUNT, "samples", whole=True),
    "frames": Range(1, _COUNT, "snapshots", whole=True),
    "kappa": Range(1e-14, 0.1, "a rate"),
    "gdot": Range(1e-14, 0.1, "a rate"),
    "strain": Range(1e-6, 1e6, "a strain"),
    "amplitude": Range(1e-6, 1e3, "a strain"),
    "period": Range(1e-3, 1e18, "a time"),
    "cycles": Range(1, _COUNT, "cycles", whole=True),
    "pure_strain": Range(1e-12, 3.0, "a strain of pure shear"),
    "strain_step": Range(1e-12, 0.1, "a step of the strain"),
    "stress_step": Range(1e-14, 1.0, "a step of the stress"),
    "strain_end": Range(1e-12, 1e6, "a strain"),
    "hold_pressure": Range(1e-12, 1.0, "a pressure", also=(0.0,)),
    "phi": Range(1e-6, 2.0, "a packing fraction"),
    "dt": Range(1e-6, 10.0, "a time step"),
    "t_box": Range(1e-3, 1e18, "a time"),
    "phi_start": Range(1e-9, 0.999, "a packing fraction"),
    "phi_end": Range(1e-6, 2.0, "a packing fraction"),
    "p_end": Range(1e-12, 1.0, "a pressure"),
    "pressure": Range(1e-12, 1.0, "a pressure"),
    "tolerance": Range(1e-14, 1.0, "an error"),
    "integration_tolerance": Range(1e-14, 1.0, "an error"),
    "accuracy": Range(1e-15, 0.5, "an error"),
    "u0": Range(1e-20, 0.01, "an energy density", also=(0.0,)),
    "largest_drop": Range(1e-6, 1.0, "a fraction of the energy", also=(math.inf,)),
    "phi_thermal": Range(1e-6, 0.999, "a packing fraction"),
    "n_sweeps": Range(0, 10**9, "sweeps", whole=True),
    "delta_phi": Range(1e-8, 0.1, "a step of the packing fraction"),
    "size_ratio": Range(1.0, 10.0, "big over small"),
    "size": Range(0.01, 100.0, "a size"),
    "share": Range(1e-6, 1e6, "a share"),
    "spread": Range(0.0, 1.0, "a spread"),
    "samples": Range(1, _COUNT, "samples", whole=True),
    "pairs": Range(1, 10**9, "pairs", whole=True),
    "seconds": Range(0.0, 1e9, "a time"),
    "evaluations": Range(1, _COUNT, "evaluations", whole=True),
    "jobs": Range(1, 1024, "processes", whole=True),
    "threads": Range(1, 1024, "threads", whole=True),
    "dpi": Range(1, 4000, "dots", whole=True),
    "follow": Range(0, _COUNT, "modes", whole=True),
    "largest": Range(0.0, 100.0, "a bound"),
}
"""Allowed ranges, in the units of the papers: those that were tested; shapes have theirs in `Parameter`. Decks use
the same."""

MOST_STEPS = 10**12
"""Most steps of a run: more would not end in a year on any machine."""


def require_number(name: str, value: Any) -> float:
    """Return a finite number as a float, or raise.

    Examples
    --------
    >>> require_number("dt", 0.5)
    0.5
    >>> require_number("dt", "4; ls")
    Traceback (most recent call last):
    ValueError: dt is '4; ls', expected a finite number
    """
    if not (_is_a(numbers.Real, value) and math.isfinite(value)):
        msg = f"{name} is {said(value)}, expected a finite number"
        raise ValueError(msg)
    return float(value)


def require_positive(**values: Any) -> None:
    """Raise unless all are finite numbers above 0.

    Examples
    --------
    >>> require_positive(dt=0.0)
    Traceback (most recent call last):
    ValueError: dt is 0.0, expected a positive number
    """
    for name, value in values.items():
        if not (_is_a(numbers.Real, value) and math.isfinite(value) and value > 0):
            msg = f"{name} is {said(value)}, expected a positive number"
            raise ValueError(msg)


def require_stated(**values: Any) -> None:
    """Raise if a number is out of its range in `RANGES`, by name.

    Raises
    ------
    ValueError

    Examples
    --------
    >>> require_stated(n=256, kappa=1e-6)
    >>> require_stated(kappa=-1.0)
    Traceback (most recent call last):
    ValueError: kappa is -1.0, expected a rate from 1e-14 to 0.1
    """
    for name, value in values.items():
        require_in(name, value, RANGES[name])


def require_given(**values: Any) -> None:
    """Check numbers like `require_stated`, skipping None."""
    require_stated(**{name: value for name, value in values.items() if value is not None})


def require_options(given: Mapping[str, Any]) -> None:
    """Check options against the range of their name, and all numbers for NaN.

    Raises
    ------
    ValueError

    Examples
    --------
    >>> require_options({"kappas": [1e-6, -1.0], "out": "a.png", "seed": None})
    Traceback (most recent call last):
    ValueError: kappa is -1.0, expected a rate from 1e-14 to 0.1
    """
    for option, values in given.items():
        for value in values if isinstance(values, list) else [values]:
            name = option if option in RANGES else option.removesuffix("s")
            if name in RANGES and _is_a(numbers.Real, value):
                require_in(name, value, RANGES[name])
            elif _is_a(numbers.Real, value) and math.isnan(value):
                msg = f"{option} is nan, expected a number"
                raise ValueError(msg)


def require_in(name: str, value: Any, allowed: Range) -> None:
    """Raise unless a number is in a range.

    Raises
    ------
    ValueError
    """
    kind = numbers.Integral if allowed.whole else numbers.Real
    if _is_a(kind, value) and (allowed.low <= value <= allowed.high or value in allowed.also):
        return
    msg = f"{name} is {said(value)}, expected {described(allowed)}"
    raise ValueError(msg)


def require_rising(phi_start: Any, phi_end: Any) -> None:
    """Raise unless a compression increases phi.

    Examples
    --------
    >>> require_rising(0.9, 0.4)
    Traceback (most recent call last):
    ValueError: phi_start is 0.9 and phi_end 0.4, expected an end above the start
    """
    require_stated(phi_start=phi_start, phi_end=phi_end)
    if not phi_start < phi_end:
        msg = f"phi_start is {phi_start} and phi_end {phi_end}, expected an end above the start"
        raise ValueError(msg)


def require_one_of(name: str, value: Any, table: Iterable[Any]) -> None:
    """Raise unless a value is in a table.

    Examples
    --------
    >>> require_one_of("integrator", "euler", ("heun", "rkc2"))
    Traceback (most recent call last):
    ValueError: integrator is 'euler', expected one of heun, rkc2
    """
    names = list(table)
    if not ((isinstance(value, str) or _is_a(numbers.Real, value)) and value in names):
        texts = [name for name in names if isinstance(name, str)]
        known = f"one of {', '.join(texts)}" if texts else " or ".join(map(str, names))
        msg = f"{name} is {said(value)}, expected {known}"
        raise ValueError(msg)


def require_path(path: Path) -> None:
    r"""Refuse the path of a file to write with control characters, or a name too long for files beside it.

    Examples
    --------
    >>> require_path(Path("a\nb"))
    Traceback (most recent call last):
    ValueError: the path 'a\nb' holds a control character, expected letters and signs; choose another name
    """
    # Bytes of a name that the locale cannot decode are allowed.
    if any(unicodedata.category(sign) == "Cc" for sign in str(path)):
        msg = (
            f"the path {str(path)!r} holds a control character, expected letters and signs;"
            " choose another name"
        )
        raise ValueError(msg)
    name = os.path.basename(os.path.realpath(path))  # noqa: PTH119 - of a link's target
    size, most = len(os.fsencode(name)), _longest_name(path) - _AFFIXES
    if size > most:
        msg = (
            f"the name of {said(str(path))} has {size} bytes, expected at most {most}, since files beside it have"
            " longer names; choose a shorter one"
        )
        raise ValueError(msg)


_AFFIXES = (
    48  # bytes that names of temporary files, locks and intermediate results add to that of a file
)


def _longest_name(path: Path) -> int:
    """Return the most bytes of a name in the folder of a path."""
    try:
        return os.pathconf(path.absolute().parent, "PC_NAME_MAX")
    except OSError:  # a missing folder, which the writer reports
        return 255


def require_other_file(out: Path, inputs: Sequence[Path]) -> None:
    """Refuse to write to an input file.

    Raises
    ------
    ValueError
    """
    require_path(out)
    require_no_folder(out)
    for path in inputs:
        if out.exists() and path.exists() and out.samefile(path):
            msg = f"{out} is an input and would be replaced, expected another output file"
            raise ValueError(msg)


def require_no_folder(path: Path) -> None:
    """Refuse the path of a file to write that is a folder.

    Raises
    ------
    ValueError
    """
    if path.is_dir():
        msg = f"{path} is a folder, expected the name of a file to write; add a name to it"
        raise ValueError(msg)


def require_folder(path: Path) -> None:
    """Refuse the path of a folder to write to that is a file.

    Raises
    ------
    ValueError
    """
    if path.exists() and not path.is_dir():
        msg = f"{path} is a file, expected a folder for the files to write; choose another name"
        raise ValueError(msg)


def require_free(out: Path, *, again: bool, go_on: str = "") -> None:
    """Refuse to replace a file without permission.

    Parameters
    ----------
    out : Path
    again : bool
        Whether ``--again`` permits it.
    go_on : str
        Alternatives for an existing file.

    Raises
    ------
    ValueError
    """
    require_path(out)
    require_no_folder(out)
    if out.exists() and not again:
        msg = f"{out} exists, expected another --out, {go_on}or --again to replace it"
        raise ValueError(msg)


def _is_a(kind: type, value: Any) -> bool:
    """Whether it is a number of a kind; booleans are not."""
    return isinstance(value, kind) and type(value) is not bool


def described(allowed: Range) -> str:
    """Describe the numbers in a range."""
    words = [f"{value:g} or" for value in allowed.also]
    low, high = (f"{v}" if allowed.whole else f"{v:g}" for v in (allowed.low, allowed.high))
    whole = "a whole number of " if allowed.whole and not allowed.meaning.startswith("a ") else ""
    return " ".join([*words, f"{whole}{allowed.meaning} from {low} to {high}"])


def _shown(value: Any) -> str:
    """Format the value of an argument in one line, NumPy scalars as Python numbers."""
    return said(value.item() if hasattr(value, "item") else value)


def said(value: Any) -> str:
    """Format a value in one line."""
    text = " ".join(str(value if isinstance(value, numbers.Real) else repr(value)).split("\n"))
    return text if len(text) <= 80 else f"{text[:77]}..."


RANKS = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS")
"""Variables for the number of processes, set by mpirun of Open MPI and MPICH, and by srun. (SLURM_NTASKS is
the allocation of a job, in which one process may run.)"""


def require_one_process(why: str = "", instead: str = "") -> None:
    """Refuse to run as one of several ranks, which would all write the same file.

    Parameters
    ----------
    why : str
        Other reason.
    instead : str
        Other advice.

    Raises
    ------
    RuntimeError
        If mpirun or srun started several.

    Examples
    --------
    >>> require_one_process()
    """
    for name in RANKS:
        ranks = os.environ.get(name, "1")
        if ranks.isdecimal() and int(ranks) > 1:
            why = why or "each would write the same file"
            unset = f"or unset {name} where each writes a file of its own"
            instead = instead or f" (jamshape sweep makes packings on all cores), {unset}"
            msg = (
                f"found {ranks} MPI ranks ({name}), expected one process, since {why};"
                f" start it without mpirun or srun{instead}"
            )
            raise RuntimeError(msg)
