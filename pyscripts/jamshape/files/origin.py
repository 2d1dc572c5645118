"""Platform on which the last bits of results depend: the processor and the libraries."""

from __future__ import annotations

import functools
import hashlib
import importlib.metadata
import math
import platform
from collections.abc import Iterable

import numpy as np

_ARGUMENTS = np.linspace(0.1, 3.1, 301)
_SIZE = 48  # of the matrix to diagonalise


@functools.cache
def origin() -> str:
    """Name the kind of processor and the libraries, with digests of their results for fixed numbers.

    Mathematical functions and linear algebra select code by processor: machines with equal texts
    give the same bits, as far as the tested numbers show.

    Returns
    -------
    str
        Such as ``x86_64; glibc 2.36, sin to pow 71c5d1f0; NumPy 2.2.0, 1f0e33aa; SciPy 1.15.0; eigenvalues 90ab12cd``.

    Examples
    --------
    >>> "NumPy" in origin() and origin() == origin()
    True
    """
    libc = " ".join(platform.libc_ver()) or platform.system()
    return "; ".join(
        [
            platform.machine(),
            f"{libc}, sin to pow {_digest(_of_c())}",
            f"NumPy {np.__version__}, {_digest(_of_numpy())}",
            f"SciPy {importlib.metadata.version('scipy')}",
            f"eigenvalues {_digest(_of_lapack())}",
        ]
    )


def _digest(values: Iterable[float]) -> str:
    """Return eight hexadecimal digits from the bits of numbers."""
    return hashlib.blake2b(np.array(list(values)).tobytes(), digest_size=4).hexdigest()


def _of_c() -> Iterable[float]:
    """Evaluate functions of the C library, which the compiled module calls as well."""
    for x in _ARGUMENTS.tolist():
        yield from (math.sin(x), math.cos(x), math.exp(x), math.log(x), math.atan2(x, 2.0))
        yield from (math.tan(x), math.pow(x, 1.7), math.acos(x / 4))


def _of_numpy() -> Iterable[float]:
    for function in (np.sin, np.cos, np.exp, np.log):
        yield from function(_ARGUMENTS)


def _of_lapack() -> Iterable[float]:
    rows = np.arange(float(_SIZE))
    return np.linalg.eigvalsh(1.0 / (1.0 + rows + rows[:, None]))
