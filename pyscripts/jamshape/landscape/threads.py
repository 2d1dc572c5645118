"""Number of threads that evaluate the contacts of a large packing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from jamshape.checks import require_stated

_THREADS = ContextVar("threads", default=1)


def threads() -> int:
    """Return the number of threads in this context; 1 by default."""
    return _THREADS.get()


@contextmanager
def sharing(number: int) -> Iterator[None]:
    """Evaluate contacts inside the context with a number of threads.

    Parameters
    ----------
    number : int
        At least 1. The last bits of results depend on it, but not on which thread is faster. Packings of
        fewer than some thousand contacts use one thread, which is as fast.

    Raises
    ------
    ValueError
        If the number is out of its range.

    Examples
    --------
    >>> from jamshape.landscape.threads import sharing, threads
    >>> with sharing(2):
    ...     threads()
    2
    >>> threads()
    1
    """
    require_stated(threads=number)
    token = _THREADS.set(number)
    try:
        yield
    finally:
        _THREADS.reset(token)
