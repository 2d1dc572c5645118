"""Base of records whose pickles and copies hold only their fields."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np


class Record:
    """Base of dataclasses whose pickles and copies hold only their fields.

    Compiled objects and cached properties are dropped, so that a record is pickled to the same
    bytes before and after use. Read-only arrays stay read-only.

    Examples
    --------
    >>> import pickle
    >>> from jamshape import Box
    >>> box = Box(lo=[0, 0], edges=[10, 12])
    >>> before, _ = pickle.dumps(box), box.matrix
    >>> before == pickle.dumps(box), pickle.loads(before).edges.flags.writeable
    (True, False)
    """

    def __getstate__(self) -> Any:
        names = [one.name for one in dataclasses.fields(self)]  # type: ignore[arg-type]
        fields = {name: getattr(self, name) for name in names}
        return fields, [name for name, value in fields.items() if _is_read_only(value)]

    def __setstate__(self, state: Any) -> None:
        fields, read_only = state
        for name, value in fields.items():
            object.__setattr__(self, name, value)
        for name in read_only:
            for array in _arrays_of(fields[name]):
                array.flags.writeable = False


def _is_read_only(value: Any) -> bool:
    return any(not array.flags.writeable for array in _arrays_of(value))


def _arrays_of(value: Any) -> list[Any]:
    """Return an array, or those of a mapping."""
    values = value.values() if isinstance(value, dict) else (value,)
    return [one for one in values if isinstance(one, np.ndarray)]
