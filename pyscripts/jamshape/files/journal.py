r"""The journal of a run: rows that are not in its HDF5 file yet, in a file of their own beside it.

HDF5 writes the pieces of a file in an order of its own, so a process that is killed in between may leave one
that no program opens. Here nothing is ever written into an HDF5 file that is in its place. What is appended to a
run goes to the end of ``NAME.h5.journal``, one record for each call, written by one call of the system; now and
then, and at the end, the rows are folded into a copy of the HDF5 file, which replaces it by a rename.

::

    jamshape journal 1\n          what it is
    TOKEN\n                       32 digits: of the HDF5 file that these rows go on from, its attribute `journal`
    record, record, ...

    record = length (8 bytes), CRC-32 (4 bytes), and its bytes:
        length of the head (4 bytes), the head as JSON, the rows of all tables, bytes of NumPy
        head = {"tables": [[name, dtype, number of rows], ...], "texts": {attribute: text}}

A record that was cut short fails its checksum; it and what follows is not read, and cut off when a writer goes
on. A journal with another token than the HDF5 file has been folded already.
"""

from __future__ import annotations

import errno
import fcntl
import json
import os
import secrets
import struct
import weakref
import zlib
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.files.disk import PathLike, real, refusals

Table = NDArray[Any]
"""Rows of a structured dtype."""

_TITLE = b"jamshape journal 1\n"
_TOKEN = 32  # digits
_START = len(_TITLE) + _TOKEN + 1
_RECORD = struct.Struct("<QI")
_HEAD = struct.Struct("<I")

# File systems that know no locks: there, as HDF5 does, nothing is locked.
_NO_LOCKS = {errno.ENOLCK, errno.ENOSYS, errno.ENOTSUP}


class Record(NamedTuple):
    """Content of one append."""

    tables: dict[str, Table]
    texts: dict[str, str]
    """Attributes that are text; numeric ones are a table."""


class Pending(NamedTuple):
    """Content of a journal."""

    token: str
    records: list[Record]
    length: int
    """Bytes up to the end of the last whole record."""


def journal_of(path: PathLike) -> Path:
    """Name the journal of a run."""
    place = real(path)
    return place.with_name(f"{place.name}.journal")


def new_token() -> str:
    """Name a state of an HDF5 file."""
    return secrets.token_hex(_TOKEN // 2)


def read_journal(path: PathLike) -> Pending | None:
    """Read the complete rows of the journal of a run; None without rows."""
    try:
        data = journal_of(path).read_bytes()
    except FileNotFoundError:
        return None
    found = parse(data)
    return found if found and found.records else None


def remove_run(path: PathLike) -> None:
    """Remove the file of a run and its journal, if they exist."""
    for place in (Path(path), journal_of(path)):
        if place.exists():  # unlink fails on a read-only disk even for missing files
            place.unlink()


def parse(data: bytes) -> Pending | None:
    """Read a journal up to where it was cut short; None if not even its beginning is whole."""
    if len(data) < _START or not data.startswith(_TITLE):
        return None
    token, at, records = data[len(_TITLE) : _START - 1].decode("latin-1"), _START, []
    while at + _RECORD.size <= len(data):
        length, checksum = _RECORD.unpack_from(data, at)
        body = memoryview(data)[at + _RECORD.size : at + _RECORD.size + length]
        if len(body) < length or zlib.crc32(body) != checksum:
            break
        records.append(_decoded(body))
        at += _RECORD.size + length
    return Pending(token, records, at)


def encoded(record: Record) -> bytes:
    """Write a record as bytes."""
    tables = ", ".join(
        f"[{json.dumps(name)}, {_described(rows.dtype)}, {len(rows)}]"
        for name, rows in record.tables.items()
    )
    head = f'{{"tables": [{tables}], "texts": {json.dumps(record.texts)}}}'.encode()
    rows = [rows.tobytes() for rows in record.tables.values()]
    body = b"".join([_HEAD.pack(len(head)), head, *rows])
    return _RECORD.pack(len(body), zlib.crc32(body)) + body


def _decoded(body: memoryview) -> Record:
    (length,) = _HEAD.unpack_from(body)
    tables, texts = _parsed(bytes(body[_HEAD.size : _HEAD.size + length]))
    at, found = _HEAD.size + length, {}
    for name, dtype, count in tables:
        found[name] = np.frombuffer(body, dtype, count, at)
        at += count * dtype.itemsize
    return Record(found, dict(texts))


@lru_cache(maxsize=64)
def _parsed(head: bytes) -> tuple[list[tuple[str, np.dtype[Any], int]], dict[str, str]]:
    """Read the head of a record; most records of a run have the same."""
    found = json.loads(head)
    tables = [
        (name, np.dtype([(field, kind, tuple(shape)) for field, kind, shape in fields]), count)
        for name, fields, count in found["tables"]
    ]
    return tables, found["texts"]


@lru_cache(maxsize=64)
def _described(dtype: np.dtype[Any]) -> str:
    fields = [(name, dtype[name].base.str, dtype[name].shape) for name in dtype.names or ()]
    return json.dumps(fields)


class Journal:
    """The journal of a run, open for one writer, who holds its lock.

    Parameters
    ----------
    path : path-like
        Path of the run's HDF5 file.

    Raises
    ------
    OSError
        If another process writes this run, or the folder is not to be written to.
    """

    def __init__(self, path: PathLike) -> None:
        self.path, self._of = journal_of(path), Path(path)
        with refusals(path, self.path):
            self._file = _locked(self.path, self._of)
        self._close = weakref.finalize(self, os.close, self._file)
        self.length = 0
        """Bytes that were written since `begin`; 0 before it."""

    def begin(self, token: str) -> None:
        """Forget all rows, and go on from the HDF5 file with this token."""
        with refusals(self._of, self.path):
            os.ftruncate(self._file, 0)
            self.length = 0
            self._write(_TITLE + token.encode() + b"\n")

    def read(self) -> Pending | None:
        """Read all rows, of this writer or an earlier one."""
        return parse(self.path.read_bytes())

    @property
    def is_empty(self) -> bool:
        """Whether no row was appended since `begin`."""
        return self.length == _START

    @property
    def is_closed(self) -> bool:
        """Whether the lock was released."""
        return not self._close.alive

    def append(self, tables: Mapping[str, Table], texts: Mapping[str, str]) -> None:
        """Write a record; what cannot be written as a whole is not written at all."""
        with refusals(self._of, self.path):
            self._write(encoded(Record(dict(tables), dict(texts))))

    def close(self, *, and_remove: bool) -> None:
        """Release the lock, of a journal that is needed no more or one to go on from."""
        if self._close.alive and and_remove:
            with suppress(OSError):  # harmless: its token matches no file any more
                self.path.unlink()
        self._close()

    def _write(self, data: bytes) -> None:
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.pwrite(self._file, rest, self.length + len(data) - len(rest)) :]
        except OSError:
            with suppress(OSError):
                os.ftruncate(self._file, self.length)
            raise
        self.length += len(data)


def _locked(path: Path, run: Path) -> int:
    """Open a journal, alone."""
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            os.close(file)
            msg = (
                f"{run}: another process writes this run, expected to be the only one;"
                " wait for its end, or end it"
            )
            raise OSError(msg) from error
        except OSError as error:
            if error.errno not in _NO_LOCKS:
                os.close(file)
                raise
            return file
        # The one before may have removed the file between these two lines.
        with suppress(FileNotFoundError):
            if path.stat().st_ino == os.fstat(file).st_ino:
                return file
        os.close(file)
