"""All frames of a dump, for tests."""

from jamshape.files.lammps_text import DumpFile


def iter_dump(path, dimension=None, shape=None):
    """Read the frames one by one; an incomplete last one is an error after the others."""
    dump = DumpFile(path, dimension, shape)
    yield from map(dump.packing, range(len(dump.index.steps)))


def read_dump(path, dimension=None, shape=None):
    """Read all frames."""
    return list(iter_dump(path, dimension, shape))
