"""Shear at a constant normal pressure."""

from __future__ import annotations

import numpy as np
import pytest

import jamshape as js

pytestmark = pytest.mark.lammps

DISCS = js.Spherocylinders(alpha=0)


def test_the_normal_pressure_is_held_and_the_height_follows(tmp_path):
    run = js.shear(DISCS, n=32, phi=0.8, gdot=1e-2, strain=4, pressure=1e-2, t_box=5.0, rows=200,
                   file=tmp_path / "run.h5", progress=False)  # fmt: skip
    found = run.steady(after=1.0)
    assert found["p_yy"].value == pytest.approx(1e-2, rel=0.1)
    assert 0.05 < found["friction"].value < 1
    assert found["friction"].value == pytest.approx(
        found["shear_stress"].value / found["p_yy"].value
    )
    assert found["phi"].value == pytest.approx(run["phi"].mean(), rel=0.05)
    assert run["phi"].std() > 0
    assert run.strain[-1] == pytest.approx(4, rel=1e-9)
    np.testing.assert_allclose(run["p_yy"], run["pressure"] - run["normal_difference"] / 2)
    assert run.about["hold_pressure"] == 1e-2


def test_a_volume_that_is_held_records_what_it_did(tmp_path):
    run = js.shear(DISCS, n=24, phi=0.8, gdot=1e-2, strain=0.2, rows=10, file=tmp_path / "run.h5", progress=False)  # fmt: skip
    assert "p_yy" not in run.observables
    assert "hold_pressure" not in run.about


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"t_box": 10.0}, "t_box=10.0 has no effect with pressure=0.0"),
        ({"pressure": 1e-3, "flow": "pure"}, "flow='pure' shear drives the height of the box"),
        ({"pressure": -1e-3}, "expected"),
        ({"pressure": 1e-3, "t_box": 0.0}, "expected"),
    ],
)
def test_what_a_pressure_cannot_go_with_is_refused(arguments, sentence, tmp_path):
    with pytest.raises(ValueError, match=sentence):
        js.shear(DISCS, n=24, file=tmp_path / "run.h5", progress=False, **arguments)
