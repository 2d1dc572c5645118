"""Damaged and hostile files: what is read is the original to the last bit, or one sentence.

All files of a kind are read in one process of their own, which must survive.
"""

import json
import zlib
from functools import cache
from pathlib import Path

import damage
import numpy as np
import pytest
from killing import ended, forked, said

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.exchange.mdanalysis import write_mdanalysis

h5py = pytest.importorskip("h5py")
pytestmark = pytest.mark.lammps

KINDS = ("packing", "run", "unfinished", "modes", "mdanalysis")
COUNTS = [
    pytest.param((8, 6), id="few"),
    pytest.param((200, 40), id="many", marks=pytest.mark.validate),
]
"""Numbers of files with a flipped bit, and of truncated files."""


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Files of each kind, as the library makes them."""
    folder = tmp_path_factory.mktemp("files")
    found, rods = {kind: folder / f"{kind}.h5" for kind in KINDS}, js.Spherocylinders(alpha=2)
    how = {"n": 8, "seed": 1, "progress": False}
    packing = js.make_packing(rods, u0=1e-8, file=found["packing"], **how)
    run = {"phi": (0.4, 0.9), "kappa": 1e-2, "rows": 60, "frames": 3, "file": found["run"]}
    js.compress(rods, **how, **run)
    with pytest.raises(TimeLimitError):
        js.compress(rods, **how, **run | {"file": found["unfinished"], "kappa": 1e-3}, seconds=0.0)
    js.save(found["modes"], js.modes(packing))
    write_mdanalysis(found["mdanalysis"], found["run"])
    return found


def read_in_a_process(kind, file, folder, jobs):
    """Read damaged files with all readers; return the results in order, and readers that never read this kind."""
    log = folder / "said.log"
    assert ended(forked(damage.read_all, (kind, file, folder, jobs), log), 1800) == 0, said(folder)
    found = json.loads((folder / "results.json").read_text())
    return found["results"], found["refused"]


def faults(jobs, results):
    return [
        (job, result["faults"])
        for job, result in zip(jobs, results, strict=True)
        if result["faults"]
    ]


@pytest.fixture(scope="module")
def damaged(files, tmp_path_factory):
    """Files with flipped bits and truncated files, both read in one process: jobs and results, and what is refused."""

    @cache
    def of(kind, counts):
        n, size = counts[0], files[kind].stat().st_size
        ends = (*np.linspace(0, size, counts[1], dtype=int)[:-1], size - 1)
        jobs = [["flip", seed] for seed in range(n)] + [["cut", int(end)] for end in ends]
        folder = tmp_path_factory.mktemp("damaged")
        results, never = read_in_a_process(kind, files[kind], folder, jobs)
        return (jobs[:n], results[:n]), (jobs[n:], results[n:]), never

    return of


@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kind", KINDS)
def test_no_flipped_bit_is_read_as_another_number(kind, counts, damaged, measured):
    (jobs, results), _, never = damaged(kind, counts)
    assert faults(jobs, results) == []
    assert never == (["load"] if kind == "mdanalysis" else [])
    refused = sum(bool(result["refused"]) for result in results)
    measured(flips=len(jobs), refused=refused)
    assert refused > 0


@pytest.mark.parametrize("counts", COUNTS)
@pytest.mark.parametrize("kind", KINDS)
def test_truncated_files_are_refused(kind, counts, damaged):
    _, (jobs, results), _ = damaged(kind, counts)
    assert faults(jobs, results) == []
    assert not any(result["same"] for result in results)


# --- hostile files ---------------------------------------------------------------------------------

FRAMES = "particles/all"
POSITION = f"{FRAMES}/position/value"


class Hostile:
    """Changes of a file, by names of datasets in it."""

    def __init__(self, file, folder):
        self.file, self.folder = file, folder
        self.secret = folder / "secret.bin"
        self.other = str(folder / "packing.h5")

    def replace(self, name, shape=None, dtype=None, **how):
        del self.file[name]
        return self.file.create_dataset(name, shape, dtype, **how)

    def huge(self, name, shape):
        chunks = tuple(min(extent, 10_000) if k == 1 else 1 for k, extent in enumerate(shape))
        self.replace(name, shape, "f8", chunks=chunks if len(shape) > 1 else (10_000,))

    def huge_with_a_checksum(self, name, shape):
        self.replace(name, shape, "f8", chunks=True, fletcher32=True)

    def huge_and_not_chunked(self, name, shape):
        self.replace(name, shape, "f8")

    def compressed(self, name, n):
        """Replace a dataset by n million zeros."""
        file = self.replace(name, (n * 10**6,), "f8", compression="gzip", chunks=(10**6,))
        zeros = zlib.compress(bytes(8 * 10**6))
        for k in range(n):
            file.id.write_direct_chunk((k * 10**6,), zeros)

    def filtered(self, name):
        values = self.file[name][()]
        self.replace(name, data=values, compression="lzf", chunks=True)

    def external(self, name):
        found = self.file[name]
        shape, dtype = found.shape, found.dtype
        size = int(np.prod(shape)) * dtype.itemsize
        self.secret.write_bytes(bytes(size))
        self.replace(name, shape, dtype, external=[(str(self.secret), 0, size)])

    def virtual(self, name):
        found = self.file[name]
        layout = h5py.VirtualLayout(found.shape, found.dtype)
        layout[...] = h5py.VirtualSource(self.other, name, found.shape)
        del self.file[name]
        self.file.create_virtual_dataset(name, layout)

    def linked(self, name):
        del self.file[name]
        self.file[name] = h5py.ExternalLink(self.other, f"/{name}")

    def moved(self, name):
        self.file.move(name, "elsewhere")
        self.file[name] = h5py.SoftLink("/elsewhere")

    def dangling(self, name):
        del self.file[name]
        self.file[name] = h5py.SoftLink("/nowhere")

    def put(self, name, data, dtype=None):
        self.replace(name, data=data, dtype=dtype)

    def named_type(self, name):
        del self.file[name]
        self.file[name] = np.dtype("f8")

    def group(self, name):
        del self.file[name]
        self.file.create_group(name)

    def attribute(self, name, key, value, dtype=None):
        self.file[name].attrs.create(key, value, dtype=dtype)


TEXT, REFERENCE = h5py.string_dtype(), h5py.ref_dtype
PAIR = np.dtype([("x", "f8"), ("y", "f8")])
RAGGED = h5py.vlen_dtype(np.dtype("f8"))

OF_A_PACKING = {
    "8 GB": lambda h: h.huge(POSITION, (1, 500_000_000, 2)),
    "24 TB": lambda h: h.huge(POSITION, (1, 1_500_000_000_000, 2)),
    "24 TB in rows": lambda h: h.huge(f"{FRAMES}/position/step", (3_000_000_000_000,)),
    "with a checksum": lambda h: h.huge_with_a_checksum(POSITION, (1, 500_000_000, 2)),
    "not chunked": lambda h: h.huge_and_not_chunked(POSITION, (1, 500_000_000_000, 2)),
    "compressed": lambda h: h.compressed(f"{FRAMES}/id", 100),
    "compressed sizes": lambda h: h.compressed(f"{FRAMES}/diameters", 100),
    "many particles": lambda h: h.huge(f"{FRAMES}/species", (10**12,)),
    "unknown filter": lambda h: h.filtered(f"{FRAMES}/diameters"),
    "external storage": lambda h: h.external(f"{FRAMES}/species"),
    "virtual": lambda h: h.virtual(f"{FRAMES}/species"),
    "external link": lambda h: h.linked(f"{FRAMES}/position"),
    "external link to all": lambda h: h.linked("particles"),
    "external link in place of a choice": lambda h: h.linked("parameters"),
    "soft link": lambda h: h.moved(f"{FRAMES}/position"),
    "dangling link": lambda h: h.dangling(f"{FRAMES}/box"),
    "text": lambda h: h.put(POSITION, np.array([["a", "b"]], object), TEXT),
    "fixed text": lambda h: h.put(POSITION, np.full((1, 8, 2), b"x")),
    "references": lambda h: h.put(f"{FRAMES}/id", [h.file.ref] * 8, REFERENCE),
    "pairs": lambda h: h.put(f"{FRAMES}/box/lo/value", np.zeros((1, 2), PAIR)),
    "ragged": lambda h: h.replace(f"{FRAMES}/id", (8,), RAGGED),
    "complex": lambda h: h.put(POSITION, np.zeros((1, 8, 2), complex)),
    "steps that are not whole": lambda h: h.put(f"{FRAMES}/position/step", [np.nan]),
    "a time that is not a number": lambda h: h.put(f"{FRAMES}/position/time", [np.nan]),
    "a named type": lambda h: h.named_type(f"{FRAMES}/id"),
    "a group": lambda h: h.group(f"{FRAMES}/diameters"),
    "a dataset for a group": lambda h: h.put(f"{FRAMES}/box", np.zeros(3)),
    "k_e of NaN": lambda h: h.attribute(FRAMES, "k_e", np.nan),
    "k_e below 0": lambda h: h.attribute(FRAMES, "k_e", -1.0),
    "k_e of many": lambda h: h.attribute(FRAMES, "k_e", np.ones(3)),
    "sides of NaN": lambda h: h.attribute(FRAMES, "sides", np.nan),
    "no sides": lambda h: h.attribute(FRAMES, "sides", 0),
    "another shape": lambda h: h.attribute(FRAMES, "shape_style", 4.0),
    "another version": lambda h: h.attribute("h5md", "version", [np.nan, 1]),
    "a version of pairs": lambda h: h.attribute("h5md", "version", np.zeros(2, PAIR)),
    "references as attribute": lambda h: h.attribute("parameters", "a", [h.file.ref], REFERENCE),
}  # fmt: skip

OF_MODES = {
    "24 TB": lambda h: h.huge("modes/eigenvalues", (3_000_000_000_000,)),
    "vectors of 24 TB": lambda h: h.huge("modes/vectors", (1_500_000, 2_000_000)),
    "compressed": lambda h: h.compressed("modes/omega", 100),
    "external storage": lambda h: h.external("modes/omega"),
    "virtual": lambda h: h.virtual("modes/omega"),
    "external link": lambda h: h.linked("modes"),
    "soft link": lambda h: h.moved("coordinates"),
    "dangling link": lambda h: h.dangling("singular_values"),
    "text": lambda h: h.put("modes/omega", np.array(["a"], object), TEXT),
    "pairs": lambda h: h.put("coordinates/direction", np.zeros((3, 3), PAIR)),
    "a number": lambda h: h.put("modes/vectors", 1.0),
    "dimension of NaN": lambda h: h.attribute("coordinates", "dimension", np.nan),
    "7 dimensions": lambda h: h.attribute("coordinates", "dimension", 7),
    "no particles": lambda h: h.attribute("coordinates", "n_all", 0),
    "references as attribute": lambda h: h.attribute("parameters", "a", [h.file.ref], REFERENCE),
}  # fmt: skip


@pytest.mark.parametrize(("kind", "cases"), [("packing", OF_A_PACKING), ("modes", OF_MODES)])
def test_hostile_files_are_refused_in_bounded_memory(kind, cases, files, tmp_path):
    jobs = []
    for number, change in enumerate(cases.values()):
        path = tmp_path / f"hostile {number}.h5"
        path.write_bytes(files[kind].read_bytes())
        with h5py.File(path, "r+", libver=("v110", "v110")) as file:
            change(Hostile(file, tmp_path))
        jobs.append(["read", path.name])
    results, _ = read_in_a_process(kind, files[kind], tmp_path, jobs)
    for name, result in zip(cases, results, strict=True):
        assert result["faults"] == [], name
        assert "load" in result["refused"], name


def test_links_that_nobody_reads_are_left_alone(files, tmp_path):
    path = tmp_path / "loop.h5"
    path.write_bytes(files["packing"].read_bytes())
    with h5py.File(path, "r+", libver=("v110", "v110")) as file:
        file["particles/all/again"] = h5py.SoftLink("/particles")
    assert damage.loaded(path)[0] == damage.loaded(files["packing"])[0]


# --- what files hold -------------------------------------------------------------------------------


def datasets(path):
    found = {}
    with h5py.File(path) as file:
        file.visititems(
            lambda name, item: found.update({name: item}) if hasattr(item, "chunks") else None
        )
        return {name: (item.fletcher32, item.shape) for name, item in found.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_every_dataset_has_a_checksum_and_the_metadata_too(kind, files):
    assert all(has and shape for has, shape in datasets(files[kind]).values())
    data = Path(files[kind]).read_bytes()
    assert data[8] == 3  # version of the superblock, with a checksum
    assert not any(old in data for old in (b"TREE", b"SNOD", b"HEAP"))  # which have none
    assert kind == "mdanalysis" or b"GCOL" not in data  # strings of variable length


@pytest.mark.parametrize("kind", ["packing", "run"])
def test_arrays_compressed_by_other_programs_are_read(kind, files, tmp_path):
    path = tmp_path / "compressed.h5"
    with h5py.File(files[kind]) as source, h5py.File(path, "w") as file:
        for name in source:
            source.copy(name, file)
        for name in (POSITION, f"{FRAMES}/diameters"):
            values = file[name][()]
            del file[name]
            file.create_dataset(name, data=values, compression="gzip", shuffle=True)
    for read in (js.load, damage.h5md.read_packing, damage.h5md.read_observables):
        read(path)
    assert damage.flat(damage.h5md.read_packing(path)) == damage.flat(
        damage.h5md.read_packing(files[kind])
    )
