"""Quasistatic shear at held normal stresses, and by steps of the shear stress."""

from functools import cache
from itertools import islice, pairwise

import numpy as np
import pytest

import jamshape as js
from jamshape.checks import ArgumentError, TimeLimitError
from jamshape.flow.quasistatic import QuasistaticShear, Sheared, shear
from jamshape.landscape import Landscape, State
from jamshape.minima.boxes import FlowError
from jamshape.vibration.elasticity import moduli
from jamshape.vibration.hessian import dynamical_matrix

PRESSURE = 1e-2
KINDS = {"discs": (js.Spherocylinders(alpha=0), 2), "spheres": (js.Superellipsoids(p=1, w1=1), 3)}


@cache
def packing(name="discs", seed=1):
    """A packing without shear stress."""
    particles, dimension = KINDS[name]
    given = {"n": 24, "seed": seed, "dimension": dimension, "pressure": PRESSURE, "box": "free"}
    return js.make_packing(particles, progress=False, **given)


def rows_of(name="discs", **how):
    start = packing(name)
    return list(shear(Landscape(start), Sheared(State.of(start)), QuasistaticShear(**how)))


@pytest.mark.parametrize("name", KINDS)
def test_a_normal_stress_is_held(name, tmp_path):
    run = js.quasistatic_shear(
        start=packing(name), pressure=PRESSURE, box="yy", step=1e-3, strain=0.02, progress=False,
        file=tmp_path / "run.h5",
    )  # fmt: skip
    first, last = run.packing(1), run.packing(len(run) - 1)
    tensor = js.energy(last).pressure_tensor
    assert tensor[1, 1] == pytest.approx(PRESSURE, rel=2e-6)
    assert abs(tensor[0, 0] / PRESSURE - 1) > 1e-3
    edges = [np.diagonal(one.box.matrix) for one in (first, last)]
    assert edges[0][0] == pytest.approx(edges[1][0], rel=1e-14)
    assert abs(edges[1][1] / edges[0][1] - 1) > 1e-6


@pytest.mark.parametrize("box", ["isotropic", "yy", "xx yy"])
def test_small_steps_lose_no_energy(box):
    """The work of each normal stress on the box is in the balance."""
    rows = rows_of(strain_step=1e-6, strain_end=1e-5, tolerance=1e-11, hold_pressure=PRESSURE, box=box)  # fmt: skip
    by_shear = sum(0.5 * abs(a.stress + b.stress) * 1e-6 for a, b in pairwise(rows))
    assert abs(sum(row.lost for row in rows)) < 1e-4 * by_shear


@pytest.mark.parametrize("box", ["isotropic", "yy", "xx yy"])
def test_work_of_cycles_at_a_pressure_is_stored_or_lost(box, tmp_path, measured):
    """Of a packing whose volume does not jump by a percent: means of two rows are not the work of that."""
    run = js.quasistatic_shear(
        start=packing(seed=5), pressure=PRESSURE, box=box, step=2e-3, amplitude=0.04, cycles=1, progress=False,
        file=tmp_path / "run.h5",
    )  # fmt: skip
    energy, per_cycle = run["u"] / run.phi * run.phi[0], run.steps_per_cycle
    for cycle in run.cycles():
        first, last = (cycle.number - 1) * per_cycle, cycle.number * per_cycle
        stored = (energy[last] - energy[first]) * run.phi[first] / run.phi[0]
        to_and_fro = 0.04 * np.ptp(run.stress[first:last])
        measured(balance=abs(cycle.work - cycle.lost - stored) / to_and_fro)
        assert abs(cycle.work - cycle.lost - stored) < 1e-6 * to_and_fro
        assert 1e-4 * to_and_fro < cycle.lost < to_and_fro


def test_the_stress_rises_in_steps_until_the_packing_yields(tmp_path):
    step = 4e-4
    run = js.quasistatic_shear(
        start=packing(), pressure=PRESSURE, stress_step=step, strain=0.3, file=tmp_path / "run.h5",
        progress=False,
    )  # fmt: skip
    held = len(run.stress) - 1
    np.testing.assert_allclose(run.stress[:held], step * np.arange(held), atol=2e-6 * PRESSURE)
    np.testing.assert_allclose(run["pressure"][:held], PRESSURE, rtol=2e-6)
    assert run.strain[-1] > 0.3 > run.strain[-2]
    assert (run["lost"] > -1e-6).all()
    found = run.yield_stress
    assert found.value - found.error == pytest.approx(step * (held - 1), rel=1e-12)
    assert found.value + found.error == pytest.approx(step * held, rel=1e-12)
    # In smaller steps the same, within the errors.
    fine = js.quasistatic_shear(
        start=packing(), pressure=PRESSURE, stress_step=step / 4, strain=0.3, progress=False
    ).yield_stress
    assert abs(fine.value - found.value) <= fine.error + found.error


def test_the_strain_of_a_small_stress_follows_from_the_modulus():
    """At held volume."""
    start, step = packing(), 1e-8
    how = QuasistaticShear(stress_step=step, tolerance=1e-11)
    rows = list(islice(shear(Landscape(start), Sheared(State.of(start)), how), 2))
    modulus = moduli(dynamical_matrix(Landscape(start), State.of(start))).simple_shear.relaxed
    assert (rows[1].strain - rows[0].strain) * modulus / step == pytest.approx(1, rel=1e-2)


def test_a_packing_that_unjams_at_constant_volume_resists_no_stress(tmp_path):
    """Its box would shear without an end at no stress."""
    start = js.make_packing(js.Spherocylinders(alpha=0), n=16, seed=2, u0=1e-6, progress=False)
    run = js.quasistatic_shear(
        start=start, stress_step=1e-4, file=tmp_path / "run.h5", progress=False
    )
    assert len(run.stress) == 2
    assert run["u"][-1] < 1e-20
    assert run.yield_stress == pytest.approx((5e-5, 5e-5))


def test_a_start_that_does_not_relax_to_no_stress_is_refused():
    start = packing()
    off = js.quasistatic_shear(start=start, step=1e-3, strain=5e-3, progress=False).packing()
    with pytest.raises(FlowError, match="before the first step of the stress the box sheared by"):
        js.quasistatic_shear(start=off, stress_step=1e-4, strain=1e-4, progress=False)


def test_it_resumes_with_the_same_bits(tmp_path):
    given = {"start": packing(), "stress_step": 1e-3, "strain": 0.1, "progress": False}
    whole = js.quasistatic_shear(file=tmp_path / "whole.h5", **given)
    for _ in range(100):
        try:
            parts = js.quasistatic_shear(file=tmp_path / "parts.h5", seconds=0.0, **given)
        except TimeLimitError:
            continue
        break
    for name in ("strain", "stress", "phi", "u", "lost"):
        assert (parts[name] == whole[name]).all()
    assert parts.yield_stress == whole.yield_stress


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"box": "yy"}, "box='yy' has no effect without pressure"),
        ({"box": "xy", "pressure": 1e-3}, "box='xy' yields where the shear holds it"),
        ({"box": "yy", "pressure": 1e-3, "flow": "pure"}, "box='yy' yields where the shear holds it"),
        ({"stress_step": 1e-4, "amplitude": 0.1}, "amplitude=0.1 has no effect with stress_step=0.0001"),
        ({"stress_step": 1e-4, "flow": "pure"}, "stress_step=0.0001 raises the stress of simple shear"),
        ({"stress_step": -1.0}, "stress_step is -1.0, expected a step of the stress from"),
    ],
)  # fmt: skip
def test_what_has_no_effect_is_refused(given, said):
    with pytest.raises((ValueError, ArgumentError)) as caught:
        js.quasistatic_shear(start=packing(), progress=False, **given)
    assert said in str(caught.value)
