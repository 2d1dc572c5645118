"""What each format keeps of a packing, of every shape in 2D and 3D, and the table of it on a page."""

import warnings
from pathlib import Path

import numpy as np
import pytest
from exchanged import PLACES, mixed, tilted

import jamshape as js
from jamshape.lammps.session import Session
from jamshape.packing import State

PAGE = Path(__file__).parents[3] / "docs/how-to/your-own-states.md"
YES, ROUNDED, NO = "yes", "to rounding", "no"
GRADES = [YES, ROUNDED, NO]
K_E = 1.0 + np.add.outer(np.arange(9), np.arange(9)) / 3  # of each pair of types


def living(packing, folder):
    """Return the packing as it is read, and as it is read with its shape and dimension stated."""
    del folder
    with Session() as session:
        session.load(packing)
        session.interact(packing.law)
        return [js.load(session)] * 2


def by_file(suffix):
    def there_and_back(packing, folder):
        if suffix == ".gsd":
            pytest.importorskip("gsd")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of columns that are left out
            js.save(folder / f"a{suffix}", packing)
        stated = {"shape": packing.shape_style, "dimension": packing.dimension}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a dump, which does not state the shape
            return [js.load(folder / f"a{suffix}", **how) for how in ({}, stated)]

    return there_and_back


FORMATS = {
    "`.h5`": by_file(".h5"),
    "`.gsd`": by_file(".gsd"),
    "`.data`": by_file(".data"),
    "`.dump`": by_file(".dump"),
    "running LAMMPS": living,
}


def exact(of):
    return lambda a, b: YES if np.array_equal(of(a), of(b)) else NO


def close(of):
    def grade(a, b):
        one, other = (np.asarray(of(x), np.longdouble) for x in (a, b))
        if np.array_equal(one, other):
            return YES
        scale = max(1.0, float(np.abs(other).max()))
        return (
            ROUNDED
            if one.shape == other.shape and np.abs(one - other).max() < 1e-14 * scale
            else NO
        )

    return grade


def rotations(packing):
    axes = [packing.body_axes(k) for k in range(packing.dimension)]
    return np.stack(axes)


# Particles that LAMMPS's columns describe alike keep their shape only where the file states it.
KEPT = {
    "shape": exact(lambda p: p.shape_style),
    "dimension": exact(lambda p: p.dimension),
    "`k_e`, also of each pair of types": exact(lambda p: p.law.k_e),
    "`sides` of rods, power of the law": lambda a, b: NO if b.shape_style == "spherocylinder" and a.law != b.law else YES,
    "sizes": exact(lambda p: p.diameters),
    "exponents, discs, corners": exact(lambda p: p.form),
    "IDs and types": exact(lambda p: [p.id, p.species]),
    "unwrapped positions": close(lambda p: p.position + p.box.vectors(p.image)),
    "orientations": close(rotations),
    "box and tilt": close(lambda p: np.concatenate([p.box.lo, p.box.edges, p.box.tilt])),
    "step": exact(lambda p: p.step),
    "time": exact(lambda p: p.time),
    "digits beyond double": exact(lambda p: np.float64(State.of(p).position - p.position)),
    "other columns: numbers": exact(lambda p: p.columns.get("c_e", [])),
    "other columns: texts": exact(lambda p: p.columns.get("element", [])),
}  # fmt: skip


def whole(name, dimension, make):
    """A packing of which everything is set."""
    packing = make(name, dimension).sorted_by_id()
    rest = 1e-18 * np.ones((packing.n, dimension))
    columns = {"c_e": np.arange(packing.n) / 3, "element": np.array(["a"] * packing.n)}
    n_types = packing.species.max()
    law = js.Interaction(K_E[:n_types, :n_types], 1)
    return packing.with_(law=law, position_rest=rest, columns=columns)


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """The worst grade by format and property."""
    worst = {}
    for name, dimension in PLACES:
        for make in (mixed, tilted):
            packing = whole(name, dimension, make)
            for title, there_and_back in FORMATS.items():
                alone, stated = there_and_back(packing, tmp_path_factory.mktemp("trip"))
                for what, grade in KEPT.items():
                    back = (alone if what in {"shape", "dimension"} else stated).sorted_by_id()
                    known = worst.setdefault((what, title), YES)
                    worst[what, title] = max(known, grade(back, packing), key=GRADES.index)
    return worst


@pytest.mark.lammps
def test_the_page_tells_what_each_format_keeps(found):
    pytest.importorskip("gsd")
    rows = [["", *FORMATS], ["---"] * (len(FORMATS) + 1)]
    rows += [[what, *(found[what, title] for title in FORMATS)] for what in KEPT]
    table = "\n".join(f"| {' | '.join(row)} |" for row in rows).replace("|  |", "| |")
    assert table in PAGE.read_text(encoding="utf-8"), table
