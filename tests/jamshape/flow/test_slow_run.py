import numpy as np
import pytest
from squeezed import squeezed

from jamshape.files.h5md import read_attributes, read_observables, read_packing, read_report
from jamshape.flow import slow_recording
from jamshape.flow.implicit import Protocol


@pytest.fixture(scope="module")
def start():
    packing, state = squeezed(8, 4, 0.8)
    return state.packing(packing)


def test_a_run_that_was_cut_off_goes_on_to_the_same_bits(start, tmp_path, monkeypatch):
    monkeypatch.setattr(slow_recording, "STEPS_PER_FRAME", 4)
    protocol = Protocol(((0.0, 1e-4), (0.801, 1e-5)), 0.803)
    paths = [tmp_path / name for name in ("whole.h5", "cut.h5")]
    for path in paths:
        slow_recording.begin(path, start, protocol, {"alpha": 4.0})
    steps = list(slow_recording.record(paths[0]))
    assert len(steps) > 8
    for step in slow_recording.record(paths[1]):
        if step.step == 7:
            break
    assert not read_attributes(paths[1])["finished"]
    assert [s.step for s in slow_recording.record(paths[1])] == list(range(5, len(steps) + 1))
    assert all(read_attributes(path)["finished"] for path in paths)
    whole, cut = map(read_packing, paths)
    np.testing.assert_array_equal(whole.position, cut.position)
    np.testing.assert_array_equal(whole.position_rest, cut.position_rest)
    np.testing.assert_array_equal(whole.orientation, cut.orientation)
    found, again = map(read_observables, paths)
    for name in (
        "phi",
        "pressure",
        "u",
        "dt",
        "error",
        "evaluations",
        "factorisations",
        "velocity",
    ):
        np.testing.assert_array_equal(found[name], again[name])
    assert found["phi"] == pytest.approx([s.phi for s in steps], rel=1e-15)
    assert len(read_report(paths[0]).step) == len(steps)
    assert read_attributes(paths[0])["flow_steps"] == len(steps)
