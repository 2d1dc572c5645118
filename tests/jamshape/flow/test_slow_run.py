import pytest
from squeezed import quickly_squeezed

import jamshape as js
from jamshape.files.h5md import read_report
from jamshape.flow.implicit import Flow, Protocol, compress
from jamshape.landscape import Landscape, State
from jamshape.protocols.approach import compressed_start
from jamshape.protocols.random_start import start_below


def test_every_step_is_in_the_file(tmp_path):
    packing, state = quickly_squeezed(8, 4, 0.8)
    start = state.packing(packing)
    rates, end = ((0.0, 1e-4), (0.801, 1e-5)), 0.803
    run = js.slow_compress(
        start=start, kappa=rates, phi=(None, end), file=tmp_path / "run.h5", progress=False
    )
    first = start.with_(law=start.law.but(sides=2))
    steps = list(compress(Landscape(first), Flow(State.of(first)), Protocol(rates, end)))
    assert len(steps) > 8
    assert run.phi == pytest.approx([step.phi for step in steps], rel=1e-15)
    assert len(read_report(run.file).step) == run.about["flow_steps"] == len(steps)


@pytest.mark.lammps
@pytest.mark.parametrize(("alpha", "phi"), [(1.0, 0.3), (50.0, 0.4)])
def test_random_starts_are_as_dense_as_asked_for(alpha, phi):
    """Random insertion reaches 0.4 with short rods, and not even 0.3 with long ones."""
    rods = js.Spherocylinders(alpha=alpha)
    run = js.slow_compress(rods, n=48, phi=(phi, 1.001 * phi), kappa=1e-6, progress=False)
    assert js.load(run.file, frame=0).phi == pytest.approx(phi, rel=1e-9)


@pytest.mark.lammps
@pytest.mark.validate
def test_contacts_of_long_rods_withstand_the_fast_compression():
    """At the rate of short ones they cross."""
    start = start_below(0.7, 64, 1, js.Spherocylinders(alpha=50))
    assert compressed_start(start, 0.7).phi == pytest.approx(0.7, rel=1e-12)
