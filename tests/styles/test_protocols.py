import numpy as np
import pytest
from mixtures import bidisperse

from jamshape.flow.compression import Compression, CompressionRun
from jamshape.lammps.session import Session
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.shape import Interaction

pytestmark = pytest.mark.lammps

ROWS, STEPS, ROWS_PER_MARK = 400, 10, 5


def compressed(end=ROWS, checkpoint=None):
    """Compress fast, so that particles leave the box; return the last checkpoint, state and rows."""
    start = random_packing(64, 0.35, 1, bidisperse(4.0))
    rows = []
    with Session() as session:
        run = CompressionRun(
            session, Compression(kappa=1e-4, phi_end=1e3, dt=0.25), start, checkpoint
        )
        for row in range(session.step // STEPS + 1, end + 1):
            run.advance(row * STEPS)
            rows.append(run.sample().observables)
            if row % ROWS_PER_MARK == 0:
                checkpoint = run.mark()
        return checkpoint, run.packing(), rows


def test_a_run_from_a_checkpoint_is_the_same_to_the_bit():
    _, whole, rows = compressed()
    checkpoint, *_ = compressed(ROWS // 2)
    _, again, others = compressed(checkpoint=checkpoint)
    np.testing.assert_array_equal(again.position, whole.position)
    np.testing.assert_array_equal(again.orientation, whole.orientation)
    assert others == rows[ROWS // 2 :]


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
