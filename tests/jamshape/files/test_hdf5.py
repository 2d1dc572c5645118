"""HDF5 files with checksums, and those of before without them."""

import errno

import numpy as np
import pytest
from nasty import assert_identical, nasty_packing

from jamshape.files import hdf5, layout
from jamshape.files.h5md import read_attributes, read_observables, read_packing, write_packing

h5py = pytest.importorskip("h5py")


@pytest.fixture
def path(tmp_path):
    return tmp_path / "packing.h5"


GIVEN = {"phi": 1 / 3, "n": 2, "finished": True, "name": "Å\n", "deck": "Å\nb" * 5000}


def test_files_of_before_are_read(path, monkeypatch):
    """Files of 0.1.0 have the oldest format, no checksums, and strings of variable length."""

    def put(group, name, array, *, grows=False):
        rows = np.asarray(array)
        how = {"maxshape": (None, *rows.shape[1:]), "chunks": (4, *rows.shape[1:])} if grows else {}
        return group.create_dataset(name, data=rows, **how)

    monkeypatch.setattr(hdf5, "_FORMAT", None)
    monkeypatch.setattr(layout, "put", put)
    monkeypatch.setattr(layout, "set_attributes", lambda group, given: group.attrs.update(given))
    packing = nasty_packing(2)
    write_packing(path, packing, GIVEN, {"pressure": 1 / 7})
    data = path.read_bytes()
    assert data[8] == 0
    assert all(old in data for old in (b"TREE", b"GCOL"))
    monkeypatch.undo()
    assert_identical(read_packing(path), packing)
    assert read_attributes(path) == GIVEN
    assert read_observables(path)["pressure"] == [1 / 7]


def test_attributes_are_replaced_by_shorter_and_longer_ones(path):
    values = ("", "x" * 1000, "ü" * 1000, "y", np.arange(500.0), 1 / 3, "z" * 100_000, True)
    with hdf5.written(path) as file:
        group = file.create_group("of")
        for value in values:
            hdf5.set_attributes(group, {"a": value, "b": 1})
            found = hdf5.attributes(file, "of")
            np.testing.assert_array_equal(found.pop("a"), value)
            assert found == {"b": 1}


def test_bytes_of_names_that_are_no_text_come_back(path):
    name = b"r\xfcn".decode(errors="surrogateescape")
    with hdf5.written(path) as file:
        hdf5.set_attributes(file, {"name": name})
        assert hdf5.attribute(file, "name") == name


def test_the_character_nul_is_refused(path):
    with pytest.raises(ValueError, match="attribute 'a' holds the character NUL, expected a text"):
        write_packing(path, nasty_packing(2), {"a": "x\0"})


def test_a_scalar_is_an_array_of_length_1_with_a_checksum(path):
    with hdf5.written(path) as file:
        dataset = hdf5.put(file, "scalar", 1 / 3)
        assert (dataset.shape, dataset.fletcher32, dataset[0]) == ((1,), True, 1 / 3)
        assert hdf5.put(file, "empty", np.zeros((0, 3))).fletcher32


@pytest.mark.parametrize("code", [errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS])
def test_files_are_read_where_the_file_system_has_no_locks(path, code, monkeypatch):
    def without_locks(name, mode, **how):
        if "locking" not in how:
            raise OSError(code, "unable to lock file")
        return opened(name, mode, **how)

    write_packing(path, nasty_packing(2))
    opened = h5py.File
    monkeypatch.setattr(h5py, "File", without_locks)
    assert_identical(read_packing(path), nasty_packing(2))
