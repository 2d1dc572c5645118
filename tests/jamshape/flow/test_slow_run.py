import pytest
from squeezed import squeezed

import jamshape as js
from jamshape.files.h5md import read_report
from jamshape.flow.implicit import Flow, Protocol, compress
from jamshape.landscape import Landscape, State


def test_every_step_is_in_the_file(tmp_path):
    packing, state = squeezed(8, 4, 0.8)
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
