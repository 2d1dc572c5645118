"""HDF5 files in which no damage passes unnoticed: written with checksums, read with every size checked.

All metadata (names, types, sizes, attributes) have the checksums of HDF5's newer format, and all datasets that of the filter
fletcher32, which needs chunks. Two places in HDF5 have none, and are not used: strings of variable length, and
attributes beyond a few kilobytes, which become datasets.

Files of others are not trusted: a dataset is read only if it is stored in the file itself, under a hard link, with as many
bytes as its shape demands.
"""

from __future__ import annotations

import errno
import io
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from jamshape.files.disk import FileFormatError as FileFormatError  # noqa: PLC0414 - passed on
from jamshape.files.disk import PathLike, store
from jamshape.files.frames import MissingFrameError
from jamshape.files.lock import NO_LOCKS
from jamshape.files.signature import HDF5, format_of

if TYPE_CHECKING:
    import h5py

_FORMAT = ("v110", "v110")  # has checksums of metadata; Debian 12 opens nothing newer
_CHUNK_BYTES = 2**20
_SMALL_BYTES = 1024  # HDF5 stores attributes above 4 kB without checksums
_ATTRIBUTE_BYTES = 60_000  # larger arrays are observables
_GZIP, _SHUFFLE, _FLETCHER = 1, 2, 3  # numbers of HDF5's filters
_LARGEST_RATIO = 1032  # of deflate
_SYSTEM = {errno.EIO, errno.ESTALE, errno.EMFILE, errno.ENFILE}  # not about content


def hdf5() -> Any:
    """Import h5py lazily, so that text files and the rest of the library need no HDF5."""
    import h5py  # noqa: PLC0415

    return h5py


# --- writing -------------------------------------------------------------------------------------


class Image(io.BytesIO):
    """An HDF5 file in memory, so that writing by HDF5 cannot fail.

    HDF5 crashes on closing a file on a full disk, so it never writes to one.
    """

    def __init__(self, path: PathLike, data: bytes = b"") -> None:
        super().__init__(data)
        self._path = path

    def __repr__(self) -> str:
        """Return the path, which h5py takes as the name of the file."""
        return str(self._path)

    def open(self, mode: str) -> h5py.File:
        """Open with h5py."""
        return hdf5().File(self, mode, libver=_FORMAT)

    def store(self) -> None:
        """Write the image to its path; errors as `replacing`.

        An error that holds a view of the buffer would be reported again when that is freed.
        """
        with self.getbuffer() as whole:
            store(self._path, whole)


@contextmanager
def written(path: PathLike) -> Iterator[h5py.File]:
    """Yield an empty HDF5 file, which replaces the one at `path` if the body succeeds.

    Raises
    ------
    OSError
        If it cannot be written; the message is one sentence.
    """
    image = Image(path)
    with image.open("w") as file:
        yield file
    image.store()


def put(group: h5py.Group, name: str, array: ArrayLike) -> h5py.Dataset:
    """Create a dataset with checksums.

    Parameters
    ----------
    group : h5py.Group
    name : str
    array : array_like
        Numbers, or characters of dtype S1; a scalar becomes an array of length 1, since HDF5 has checksums for
        chunks only.
    """
    rows = np.atleast_1d(np.asarray(array))
    row_bytes = rows.dtype.itemsize * math.prod(rows.shape[1:])
    n = max(1, min(_CHUNK_BYTES // max(1, row_bytes), len(rows)))
    return group.create_dataset(
        name,
        data=rows,
        # HDF5 requires chunks of at least 1 within the maximum: an empty extent gets no maximum.
        maxshape=tuple(extent or None for extent in rows.shape),
        chunks=(n, *(extent or 1 for extent in rows.shape[1:])),
        fletcher32=True,
    )


def check_attributes(attributes: Mapping[str, Any]) -> None:
    """Refuse values that HDF5 cannot hold as attributes."""
    for name, value in attributes.items():
        array = np.asarray(value)
        if array.dtype.kind not in "biuf" and not isinstance(value, str):
            msg = f"attribute {name!r} is {type(value).__name__}, expected numbers or a str"
            raise ValueError(msg)
        if isinstance(value, str) and "\0" in value:
            msg = f"attribute {name!r} holds the character NUL, expected a text without it"
            raise ValueError(msg)
        if array.ndim and array.nbytes > _ATTRIBUTE_BYTES:
            found = f"attribute {name!r} has {array.nbytes} bytes"
            msg = f"{found}, expected at most {_ATTRIBUTE_BYTES}; store it as an observable"
            raise ValueError(msg)


def set_attributes(group: h5py.Group | h5py.Dataset, attributes: Mapping[str, Any]) -> None:
    """Set attributes, replacing those of the same name; long ones are datasets of the group.

    Raises
    ------
    ValueError
        If HDF5 cannot hold one.
    """
    check_attributes(attributes)
    for name, value in attributes.items():
        if hasattr(group, "keys") and name in group:
            del group[name]
        text = value.encode(errors="surrogateescape") if isinstance(value, str) else None
        size = np.asarray(value).nbytes if text is None else len(text)
        if size > _SMALL_BYTES:
            put(group, name, value if text is None else np.frombuffer(text, "S1"))
            group.attrs.pop(name, None)
        elif text is None:
            group.attrs[name] = value
        else:
            kind = hdf5().string_dtype("utf-8", max(1, size))
            group.attrs.create(name, np.array(text), dtype=kind)


# --- reading -------------------------------------------------------------------------------------


@contextmanager
def reading(path: PathLike) -> Iterator[h5py.File]:
    """Open a file for reading; damage, found here or in the body, becomes a FileFormatError."""
    with readable(path), open_file(path) as file:
        yield file


def open_file(path: PathLike) -> h5py.File:
    """Open a file for reading, on file systems without locks as well."""
    try:
        return hdf5().File(path, "r")
    except OSError as error:
        if error.errno not in NO_LOCKS:
            raise
        return hdf5().File(path, "r", locking=False)


@contextmanager
def readable(path: PathLike) -> Iterator[None]:
    """Refuse files other than HDF5, and turn errors of any type on damaged ones into a FileFormatError.

    Raises
    ------
    FileFormatError
    OSError
        If the system cannot read the file, or another program writes it.
    """
    if format_of(path) != HDF5:
        msg = f"{path}: is not an HDF5 file, expected one written by jamshape"
        raise FileFormatError(msg)
    try:
        yield
    except (FileFormatError, MissingFrameError, ImportError):
        raise
    except BlockingIOError as error:
        msg = (
            f"{path}: another program has it open for writing, expected read access; close it there"
        )
        raise OSError(errno.EAGAIN, msg) from error
    except Exception as error:  # HDF5's errors on damage have any type
        if isinstance(error, OSError) and error.errno in _SYSTEM:
            raise
        msg = f"{path}: is truncated or damaged, expected a complete HDF5 file; write it again"
        raise FileFormatError(msg) from error


def has_item(parent: h5py.Group, name: str) -> bool:
    """Whether a file or group has a group or dataset, or a link in its place, which is not followed."""
    try:
        return _link_in(parent, name) is not None
    except KeyError:
        return False


def require_item(parent: h5py.Group, name: str) -> Any:
    """Return a group or dataset that is in the file itself, or refuse the file."""
    try:
        link = _link_in(parent, name)
    except KeyError as error:
        msg = f"{parent.file.filename}: has no /{name}, expected an H5MD file written by jamshape"
        raise FileFormatError(msg) from error
    if link:
        msg = f"{parent.file.filename}: /{link} is a link to elsewhere, expected the data themselves; copy them"
        raise FileFormatError(msg)
    return parent[name]


def _link_in(parent: h5py.Group, name: str) -> str:
    """Return the first prefix of a path that is a soft or external link, "" without; KeyError if an item is missing."""
    parts = name.split("/")
    for k in range(1, len(parts) + 1):
        part = "/".join(parts[:k])
        if not parent.id.links.exists(part.encode()):
            raise KeyError(part)
        if parent.id.links.get_info(part.encode()).type != hdf5().h5l.TYPE_HARD:
            return part
    return ""


def require_dataset(
    parent: h5py.Group,
    name: str,
    n: int | None = None,
    *,
    kinds: str = "biuf",
    sparse: bool = False,
) -> Any:
    """Return a dataset that can be read within bounds, or refuse the file.

    Parameters
    ----------
    parent : h5py.File or h5py.Group
    name : str
    n : int, optional
        Number of rows that will be read; all by default.
    kinds : str
        Accepted kinds of dtypes.
    sparse : bool
        Whether chunks may be missing, which then read as 0; its shape should be checked otherwise.
    """
    dataset = require_item(parent, name)
    if not hasattr(dataset, "shape"):
        msg = f"{parent.file.filename}: /{name} is a group, expected a dataset"
        raise FileFormatError(msg)
    shape: tuple[int, ...] = dataset.shape
    if n is not None and shape:
        shape = (min(n, shape[0]), *shape[1:])
    if problem := _problem(dataset, shape, sparse) or _problem_of_type(dataset, kinds):
        msg = f"{parent.file.filename}: /{name} {problem}; write it again"
        raise FileFormatError(msg)
    return dataset


def _problem_of_type(dataset: h5py.Dataset, kinds: str) -> str:
    kind = dataset.dtype.kind
    return "" if kind in kinds else f"has dtype {dataset.dtype}, expected numbers"


def _problem(dataset: h5py.Dataset, shape: tuple[int, ...], sparse: bool) -> str:
    """Describe why rows of a dataset should not be read; "" if they may be."""
    made = dataset.id.get_create_plist()
    if made.get_layout() == hdf5().h5d.VIRTUAL or made.get_external_count():
        return "is stored in other files, expected the data themselves"
    filters = {made.get_filter(k)[0] for k in range(made.get_nfilters())}
    if filters - {_GZIP, _SHUFFLE, _FLETCHER}:
        return "is stored with an unknown filter, expected gzip, shuffle or fletcher32"
    chunks = dataset.chunks or (1,) * len(shape)
    n_chunks = math.prod(-(-extent // chunk) for extent, chunk in zip(shape, chunks, strict=True))
    needed = n_chunks * math.prod(chunks) * dataset.dtype.itemsize
    stored = dataset.id.get_storage_size()
    most = stored * (_LARGEST_RATIO if _GZIP in filters else 1)
    if stored > dataset.file.id.get_filesize() or (needed > most and not sparse):
        return f"claims {needed} bytes and stores {stored}, expected all of them"
    return ""


def attribute(item: Any, name: str, otherwise: Any = None) -> Any:
    """Read an attribute, as bool, int, float, str or array; `otherwise` if missing."""
    return _plain(item, name) if name in item.attrs else otherwise


def attributes(parent: h5py.Group, name: str) -> dict[str, Any]:
    """Read the attributes of a group, those that are datasets as well."""
    group = require_item(parent, name)
    found = attributes_of(group)
    for key in group:
        array = require_dataset(group, key, kinds="biufS")[()]
        is_text = array.dtype.kind == "S"
        found[key] = _text(array.tobytes()) if is_text else array
    return found


def attributes_of(item: Any) -> dict[str, Any]:
    """Read the attributes of a group that are not datasets."""
    return {name: _plain(item, name) for name in item.attrs}


def _plain(item: Any, name: str) -> Any:
    h5a, file = hdf5().h5a, item.file
    stored = h5a.open(item.id, name.encode())
    is_text = hdf5().check_string_dtype(stored.dtype) is not None
    if stored.dtype.kind not in "biuf" and not is_text:
        msg = f"{file.filename}: the attribute {name} has dtype {stored.dtype}, expected numbers or text"
        raise FileFormatError(msg)
    if stored.get_storage_size() > file.id.get_filesize():
        msg = (
            f"{file.filename}: the attribute {name} is larger than the file, expected a part of it"
        )
        raise FileFormatError(msg)
    return plain(item.attrs[name])


def plain(value: Any) -> Any:
    """Convert NumPy scalars to Python, and bytes to str."""
    if isinstance(value, bytes):
        return _text(value)
    return value.item() if isinstance(value, np.generic) else value


def as_read(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Return attributes as a file gives them back.

    Examples
    --------
    >>> as_read({"n": np.int64(16), "kappa": [1, 2]})
    {'n': 16, 'kappa': array([1, 2])}
    """
    return {
        name: value if isinstance(value, str) else plain(np.asarray(value)[()])
        for name, value in attributes.items()
    }


def _text(data: bytes) -> str:
    return data.decode(errors="surrogateescape")
