"""Every public object is pickled and copied: the same bytes before and after use, in every kind of process."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import importlib
import inspect
import math
import multiprocessing
import os
import pickle
import pkgutil
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
import scipy.sparse

import jamshape
import jamshape as js
from jamshape.contacts import Contacts
from jamshape.landscape import Landscape, State
from jamshape.protocols.defaults import recipe_for
from jamshape.records import Record
from jamshape.shapes.table import SHAPES
from jamshape.vibration.elasticity import moduli

pytestmark = pytest.mark.lammps  # which one of the runs is made by

RODS = {"alpha": 1}
QUICK = {"n": 12, "progress": False}


def packed(**how):
    return js.make_packing(js.Spherocylinders(**RODS), u0=1e-8, **QUICK, **how)


def compressed(**how):
    rods = js.Spherocylinders(alpha=4)
    return js.compress(rods, phi=(0.5, 0.95), kappa=2e-2, rows=20, frames=2, **QUICK, **how)


def sheared(**how):
    discs = js.Spherocylinders(alpha=0)
    return js.shear(discs, phi=0.8, gdot=2e-2, strain=0.2, rows=5, frames=2, **QUICK, **how)


def cyclic(**how):
    discs = js.Spherocylinders(alpha=0)
    return js.cyclic_shear(
        discs, phi=0.8, amplitude=0.02, period=20, cycles=2, rows=8, **QUICK, **how
    )


def quasistatic(**how):
    return js.quasistatic_shear(start=packed(**how), step=2e-3, strain=4e-3, progress=False)


def made(folder):
    """Give one object of each kind by name, none of them used yet."""
    packing, run = packed(file=folder / "packing.h5"), compressed()
    modes = js.modes(packing)
    modes.save(folder / "modes.h5")
    matrix, table = modes.matrix, modes.table
    plain = js.load(folder / "packing.h5")
    return {
        "Box": js.Box(lo=[0, 0], edges=[10, 12], tilt=[3]),
        "Packing": packing,
        "Packing of arrays": js.Packing.of("spherocylinder", [[1, 2]], [0], box=[9, 9], alpha=4),
        "its copy": plain.with_(step=3),
        "Kind": js.Kind({"alpha": 1}, size=1.2),
        "Particles": js.Spherocylinders(alpha=4),
        "Particles mixed": js.Superellipsoids(p=[1, 1.5], size=[1, 1.2], spread=[0.1, 0.0]),
        "Particles given": js.Particles.given("dimer", [[2.0, 1.0, 1.0]] * 4),
        "Modes": modes,
        "Modes of a file": js.load(folder / "modes.h5"),
        "ModeTable": table,
        "DynamicalMatrix": matrix,
        "Moduli": moduli(matrix),
        "Contacts": Contacts.of(packing),
        "ContactNetwork": Contacts.of(packing).network,
        "State": State.of(packing),
        "Landscape": Landscape(packing),
        "Recipe": recipe_for(js.Dimers(), None, 1, "dynamics"),
        "RunFile": run,
        "RunFile of a file": compressed(file=folder / "run.h5"),
        "OnsetFit": run.onset(),
        "Jamming": run.jamming(progress=False),
        "ShearFile": sheared(),
        "CyclicShearFile": cyclic(),
        "QuasistaticShearFile": quasistatic(),
        "EnsembleFile": js.ensemble(js.Spherocylinders(**RODS), seeds=[1, 2], u0=1e-8, **QUICK),
        "LadderFile": js.ladder(packing, u0=[1e-7], progress=False),
        "Event": quasistatic().events(),
        "Energy": js.energy(packing, hessian=True, compatibility=True),
        "Nonaffine": js.nonaffine(packing, packing.with_(position=packing.position + 0.1)),
        "Interaction": js.Interaction(2.0, 1),
        "NotReachedWarning": js.NotReachedWarning("try {strict}", {"strict": True}),
    } | {f"shape {name}": shape for name, shape in SHAPES.items()}


@pytest.fixture(scope="module")
def objects(tmp_path_factory):
    return made(tmp_path_factory.mktemp("objects"))


NAMES = """Box|Packing|Packing of arrays|its copy|Kind|Particles|Particles mixed|Particles given|Modes|Modes of a file
ModeTable|DynamicalMatrix|Moduli|Contacts|ContactNetwork|State|Landscape|Recipe|RunFile|RunFile of a file|OnsetFit
Jamming|ShearFile|CyclicShearFile|QuasistaticShearFile|EnsembleFile|LadderFile|Event|Energy|Nonaffine|Interaction|NotReachedWarning""".replace(
    "\n", "|"
).split("|")
NAMES += [f"shape {name}" for name in SHAPES]


def use(thing):
    """Ask for all that it computes of itself."""
    for name, one in inspect.getmembers(type(thing)):
        if isinstance(one, property | cached_property) and not name.startswith("__"):
            getattr(thing, name)
    repr(thing)


def same(one, other):
    """Whether two objects are alike in type, fields and arrays, bit by bit."""
    if type(one) is not type(other):
        return False
    if isinstance(one, np.ndarray):
        flags = one.flags.writeable == other.flags.writeable
        return flags and one.dtype == other.dtype and one.tobytes() == other.tobytes()
    if scipy.sparse.issparse(one):
        return (one != other).nnz == 0
    if dataclasses.is_dataclass(one):
        names = [f.name for f in dataclasses.fields(one)]
        return all(same(getattr(one, name), getattr(other, name)) for name in names)
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[k], other[k]) for k in one)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, Landscape):
        return same(vars(one)["particles"], vars(other)["particles"])
    if isinstance(one, Exception):
        return one.args == other.args and str(one) == str(other)
    is_nan = isinstance(one, float) and math.isnan(one)
    return math.isnan(other) if is_nan else one == other


def same_run(one, other):
    """Whether files of runs hold the same: without a file of their own they lie elsewhere."""
    return one.file.read_bytes() == other.file.read_bytes()


def alike(one, other):
    return (same_run if hasattr(one, "folder") else same)(one, other)


def test_every_public_class_is_tried(objects):
    assert list(objects) == NAMES
    classes = {name for name in js.__all__ if inspect.isclass(getattr(js, name))} - {"Session"}
    assert classes <= objects.keys()
    assert all(type(objects[name]).__name__ == name for name in classes)


@pytest.mark.parametrize("name", NAMES)
def test_pickles_and_copies_hold_the_same_before_and_after_use(objects, name):
    thing = objects[name]
    before = pickle.dumps(thing)
    use(thing)
    assert pickle.dumps(thing) == before
    for twin in (pickle.loads(before), copy.deepcopy(thing), copy.copy(thing)):
        assert alike(thing, twin)
        use(twin)


def test_a_session_is_not_pickled():
    with js.Session() as session:
        for copied in (pickle.dumps, copy.copy, copy.deepcopy):
            with pytest.raises(
                TypeError, match=r"^a Session holds a running LAMMPS, .* session.packing"
            ):
                copied(session)


def test_a_copy_of_a_run_without_a_file_outlives_it():
    run = quasistatic()
    twin, expected, gone = copy.deepcopy(run), run.stress, run.file
    del run
    assert not gone.exists()
    np.testing.assert_array_equal(twin.stress, expected)


def used(things):
    """Use objects elsewhere and send them back."""
    for thing in things.values():
        use(thing)
    return things


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_objects_go_to_other_processes_and_come_back(objects, method):
    with ProcessPoolExecutor(1, multiprocessing.get_context(method)) as pool:
        back = pool.submit(used, objects).result()
    for name, thing in objects.items():
        assert alike(thing, back[name]), name
        assert not hasattr(thing, "folder") or thing.file.exists(), name


def modules():
    for found in pkgutil.walk_packages(jamshape.__path__, "jamshape."):
        if not found.name.startswith(
            ("jamshape.commands", "jamshape.__main__", "jamshape.lammps.deck.__main__")
        ):
            with contextlib.suppress(ImportError):
                yield importlib.import_module(found.name)


def test_what_keeps_what_it_has_computed_is_a_record():
    """Others would take compiled objects and arrays along in their pickles."""
    classes = {
        c
        for m in modules()
        for c in vars(m).values()
        if dataclasses.is_dataclass(c) and inspect.isclass(c)
    }
    keeping = {c for c in classes if any(isinstance(v, cached_property) for v in vars(c).values())}
    assert len(keeping) > 5
    assert all(issubclass(c, Record) or "__reduce__" in vars(c) for c in keeping), keeping


# --- where functions are called -------------------------------------------------------------------


def numbers(seed):
    """Call every function that makes something; the bits of what it made."""
    rods = js.Spherocylinders(**RODS)
    packing = packed(seed=seed)
    to = {"phi": (None, packing.phi + 1e-5), "kappa": 1e-3}
    slow = js.slow_compress(start=packing, **to, progress=False)
    return [
        packing.position.tobytes(),
        js.modes(packing).eigenvalues.tobytes(),
        compressed(seed=seed).pressure.tobytes(),
        sheared(seed=seed).pressure.tobytes(),
        quasistatic(seed=seed).stress.tobytes(),
        slow.pressure.tobytes(),
        repr(rods).encode(),
    ]


def test_functions_give_the_same_in_threads_and_processes():
    """LAMMPS, HDF5 and bars run beside each other, in threads and in processes forked after LAMMPS began."""
    seeds = [1, 1]
    expected = [numbers(1)] * 2
    with ThreadPoolExecutor(2) as pool:
        assert list(pool.map(numbers, seeds)) == expected
    with ProcessPoolExecutor(2, multiprocessing.get_context("fork")) as pool:
        assert list(pool.map(numbers, seeds)) == expected


def bars(seed):
    return packed(seed=seed) and js.make_packing(
        js.Spherocylinders(**RODS), n=16, u0=1e-8, seed=seed, progress=True
    )


def test_bars_of_threads_end(capfd):
    with ThreadPoolExecutor(2) as pool:
        assert len(list(pool.map(bars, [1, 2]))) == 2
    assert "compression" in capfd.readouterr().err


def test_a_forked_process_leaves_files_to_its_parent():
    run = quasistatic()
    child = os.fork()
    if child == 0:
        run.folder._end()  # as at the end of a process
        os._exit(0)
    os.waitpid(child, 0)
    assert Path(run.file).exists()
