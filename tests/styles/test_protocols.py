import numpy as np
import pytest
from mixtures import bidisperse

from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.shape import Interaction

pytestmark = pytest.mark.lammps

ROWS, STEPS, ROWS_PER_RESTART = 400, 10, 5


def compressed(path=None):
    """Compress fast, so that particles leave the box, writing restart files."""
    start = random_packing(64, 0.35, 1, bidisperse(4.0))
    rows = []
    with Session() as session:
        run = CompressionRun(session, Compression(kappa=1e-4, phi_end=1e3, dt=0.25), start)
        for row in range(1, ROWS + 1):
            run.advance(row * STEPS)
            if path and row % ROWS_PER_RESTART == 0:
                run.write_restart(path)
            rows.append(run.sample().observables)
        return run.packing(), rows


def test_writing_restart_files_does_not_change_a_run(tmp_path):
    plain, rows = compressed()
    written, others = compressed(tmp_path / "now.restart")
    apart = np.abs(plain.position - written.position)
    apart = np.minimum(apart, plain.box.edges - apart)  # one may have crossed the border earlier
    assert apart.max() < 1e-9 * plain.box.edges.min()
    for name in ("pressure", "u"):
        one, other = (np.array([row[name] for row in found]) for found in (rows, others))
        np.testing.assert_allclose(other, one, rtol=1e-6, atol=1e-15)


def test_a_session_takes_any_ids_and_gives_them_back():
    start = random_packing(6, 0.2, 1, bidisperse(2.0)).with_(id=[9, 2, 70, 4, 5, 1])
    with Session() as session:
        session.load(start)
        session.interact(Interaction())
        session.commands(f"{session.neighbours()}\nrun 0 post no")
        found = session.packing()
    expected = start.sorted_by_id()
    for name in ("id", "species", "diameters"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    np.testing.assert_allclose(found.position, expected.position, rtol=0, atol=1e-14)
