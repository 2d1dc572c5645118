"""By how many threads the contacts of a large packing are evaluated."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

from jamshape.checks import require_stated

_THREADS = ContextVar("threads", default=1)


def threads() -> int:
    """Return their number where this is called: 1 if nobody said another."""
    return _THREADS.get()


@contextmanager
def sharing(number: int) -> Iterator[None]:
    """Share the contacts of what is minimised or compressed inside among so many threads.

    Parameters
    ----------
    number : int
        At least 1. The last bits of results depend on it, not on which thread is faster. Packings of
        fewer than some thousand contacts are evaluated by one, which takes no longer.

    Raises
    ------
    ValueError
        If it is no number of threads.

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
