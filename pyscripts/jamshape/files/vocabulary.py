"""Names in files, their version, and published protocols."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jamshape.files.disk import PathLike
from jamshape.files.hdf5 import FileFormatError

FORMAT_VERSION = 3
"""Version of these names and of the layout; 2 and, for files that do not state one, 1 are those of jamshape 0.1.0."""

KIND = "kind"
"""Attribute of the files of drivers."""

ENSEMBLE = "ensemble"
"""Kind of the files of ensembles."""

COMPRESSED, ATHERMAL, THERMAL = "marschall-2018", "yuan-2019-1", "yuan-2019-2"
"""Published protocols, by name."""

MINIMISED = "minimise"
"""Protocol of a state of one's own that was minimised at its box."""

NUMBERED: Mapping[int, str] = {1: ATHERMAL, 2: THERMAL}
"""Protocols by their numbers in Yuan et al. 2019."""


def protocol_named(value: Any) -> Any:
    """Return the name of a numbered protocol; other values stay as they are.

    Examples
    --------
    >>> protocol_named(2), protocol_named("2"), protocol_named("yuan-2019-1")
    ('yuan-2019-2', 'yuan-2019-2', 'yuan-2019-1')
    """
    return {str(number): name for number, name in NUMBERED.items()}.get(str(value), value)


def require_format(path: PathLike, version: int, creator: str) -> None:
    """Refuse a file of another format version.

    Parameters
    ----------
    path : path-like
    version : int
        Format version of the file.
    creator : str
        Version of jamshape that wrote it.

    Raises
    ------
    FileFormatError
    """
    if version == FORMAT_VERSION:
        return
    advice = (
        f"run jamshape convert {path}" if version < FORMAT_VERSION else "read it with that version"
    )
    msg = f"{path} was written by jamshape {creator} (format {version}), expected format {FORMAT_VERSION}; {advice}"
    raise FileFormatError(msg)
