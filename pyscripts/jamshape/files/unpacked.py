"""Files compressed by gzip or Zstandard, as LAMMPS's package COMPRESS writes dumps."""

from __future__ import annotations

import gzip
import os
import shutil
import subprocess
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from jamshape.files.disk import FileFormatError, PathLike

GZIP, ZSTD = "gzip", "Zstandard"
PACKED = {GZIP: b"\x1f\x8b", ZSTD: b"\x28\xb5\x2f\xfd"}
"""First bytes of compressed files."""

_HEAD = 4096  # bytes within which a LAMMPS data file states its box
_DAMAGE = (EOFError, zlib.error, gzip.BadGzipFile)


def head_of(path: PathLike) -> bytes:
    """Return the first bytes of the content of a file, without compression; errors as `opened_plain`."""
    with Path(path).open("rb") as file, _stream(path, file) as stream:
        return bytes(stream.read(_HEAD))


def opened_plain(path: PathLike) -> IO[bytes]:
    """Open the content of a file for reading at any place; compressed content is unpacked to a temporary file.

    Raises
    ------
    FileFormatError
        If a compressed file is cut or damaged, or the program for it is missing.
    OSError
        If the file cannot be read.
    """
    file = Path(path).open("rb")  # noqa: SIM115 - the caller closes it
    if not _kind_of(file):
        return file
    found = tempfile.TemporaryFile()  # noqa: SIM115 - likewise
    with file, _stream(path, file) as stream:
        shutil.copyfileobj(stream, found)
    found.seek(0)
    return found


def _kind_of(file: IO[bytes]) -> str:
    head = file.read(4)
    file.seek(0)
    return next((kind for kind, mark in PACKED.items() if head.startswith(mark)), "")


@contextmanager
def _stream(path: PathLike, file: IO[bytes]) -> Iterator[Any]:
    """Yield the content of an open file as a stream."""
    kind = _kind_of(file)
    try:
        if kind == GZIP:
            with gzip.open(file) as stream:
                yield stream
        elif kind == ZSTD:
            with _zstd(path, file) as stream:
                yield stream
        else:
            yield file
    except _DAMAGE as error:
        msg = f"{path}: the compressed file is cut or damaged ({error}), expected a whole one; write it again"
        raise FileFormatError(msg) from error


@contextmanager
def _zstd(path: PathLike, file: IO[bytes]) -> Iterator[Any]:
    program = shutil.which("zstd")
    if program is None:
        msg = f"{path} is compressed with Zstandard, expected the program zstd to unpack it; install zstd"
        raise FileFormatError(msg)
    os.lseek(file.fileno(), 0, os.SEEK_SET)
    command = [program, "-dcq"]
    with subprocess.Popen(
        command, stdin=file, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as process:
        assert process.stdout is not None
        yield process.stdout
        if not process.stdout.read(1) and process.wait():
            msg = "zstd does not unpack it"
            raise EOFError(msg)
        process.kill()
