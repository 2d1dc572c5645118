"""make_packing and minimise to a pressure, a packing fraction or an energy, in boxes that yield."""

import numpy as np
import pytest
from in_process import jamshape

import jamshape as js
from jamshape.checks import ArgumentError, TimeLimitError
from jamshape.landscape import Landscape, State
from jamshape.vibration.stability import stability_of

DISCS = js.Spherocylinders(alpha=0)
TARGETS = (
    {"pressure": 1e-4}, {"pressure": 1e-4, "box": "free"}, {"u0": 1e-8, "box": "free"},
    {"phi": 0.88}, {"phi": 0.88, "box": "free"}, {"pressure": 1e-5, "box": "yy xy"},
)  # fmt: skip


def made(**given):
    return js.make_packing(DISCS, n=20, progress=False, **given)


def square(n=4, overlap=1e-3):
    """Equal discs on a square lattice: at rest, and a saddle of the enthalpy."""
    at = np.arange(n) + 0.5
    position = (1 - overlap) * np.array(np.meshgrid(at, at)).reshape(2, -1).T
    edges = [n * (1 - overlap)] * 2
    return js.Packing.of("spherocylinder", position=position, box=edges, alpha=0)


@pytest.mark.parametrize("target", TARGETS, ids=str)
def test_a_packing_has_its_target(target):
    packing = made(**target)
    assert packing.reached
    for name in ("pressure", "phi"):
        if name in target and target.get("box") != "yy xy":
            assert getattr(packing, name) == pytest.approx(target[name], rel=1e-8)
    if "u0" in target:
        assert packing.u == pytest.approx(target["u0"], rel=1e-8)
    tensor = js.energy(packing).pressure_tensor
    if target.get("box") == "free":
        np.testing.assert_allclose(
            tensor, packing.pressure * np.eye(2), atol=2e-8 * packing.pressure
        )
    if target.get("box") == "yy xy":
        np.testing.assert_allclose(tensor[1], [0, 1e-5], atol=1e-12)


def test_an_isotropic_box_by_pressure_and_by_energy_is_one_state():
    by_pressure = made(pressure=1e-4)
    by_energy = js.minimise(by_pressure, u0=by_pressure.u, progress=False)
    assert by_energy.phi == pytest.approx(by_pressure.phi, rel=1e-12)
    assert by_pressure.box.matrix[0, 1] == 0


@pytest.mark.parametrize("seconds", [0.1, pytest.param(0.0, marks=pytest.mark.validate)])
@pytest.mark.parametrize("target", TARGETS[:3], ids=str)
def test_it_resumes_with_the_same_bits(target, seconds, tmp_path):
    """Put down at its first mark, and every second time only after these seconds."""
    whole = made(file=tmp_path / "whole.h5", **target)
    parts = tmp_path / "parts.h5"
    for stops in range(1000):
        try:
            found = made(file=parts, seconds=seconds * (stops % 2), **target)
        except TimeLimitError:
            continue
        break
    assert stops > 0
    assert (found.position == whole.position).all()
    assert (found.box.matrix == whole.box.matrix).all()
    assert found.results["box_steps"] == whole.results["box_steps"]
    with pytest.raises(ValueError, match="expected"):
        made(file=parts, **target | {"accuracy": 1e-7})


def test_a_saddle_of_the_enthalpy_is_left():
    """Isotropic boxes stay on it by symmetry, which has no shear stress; the bordered Hessian does not."""
    still = js.minimise(square(), pressure=2e-3, progress=False)
    assert stability_of(Landscape(still), State.of(still)).sign == -1
    assert abs(still.phi - np.pi / 4) < 0.01
    stable = js.minimise(still, pressure=2e-3, stable_to_shear=True, progress=False)
    assert stable.reached
    assert stable.results["tries"] > 1
    assert stable.results["bordered_eigenvalue"] > -stable.results["bordered_eigenvalue_bound"]
    assert stable.phi > 0.9  # of the hexagonal lattice, 0.9069
    tensor = js.energy(stable).pressure_tensor
    np.testing.assert_allclose(tensor, 2e-3 * np.eye(2), atol=4e-11)


def test_packings_that_are_stable_to_shear():
    packing = made(pressure=1e-3, stable_to_shear=True)
    assert packing.reached
    assert packing.results["tries"] >= 1
    assert stability_of(Landscape(packing), State.of(packing)).sign >= 0


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"box": "fixed"}, "box='fixed' keeps the packing fraction of the start"),
        ({"pressure": 1e-3, "u0": 1e-6}, "u0=1e-06 has no effect with pressure=0.001"),
        ({"pressure": 1e-3, "phi": 0.8}, "phi=0.8 has no effect with pressure=0.001"),
        ({"pressure": 1e-3, "strict": True}, "strict=True works at a given energy or box, found box='isotropic'"),
        ({"pressure": 1e-3, "box": "xy"}, "box='xy' keeps the volume"),
        ({"protocol": "steps", "box": "free"}, "box='free' needs a target, expected pressure, u0 or phi as well"),
        ({"pressure": 5.0}, "pressure is 5.0, expected a pressure from 1e-12 to 1"),
        (
            {"pressure": 1e-3, "box": "isotropic", "stable_to_shear": True},
            "stable_to_shear=True needs a box that is free, found box='isotropic'",
        ),
    ],
)  # fmt: skip
def test_what_contradicts_is_refused(given, said):
    with pytest.raises((ValueError, ArgumentError)) as caught:
        made(**given)
    assert said in str(caught.value)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"box": "free"}, "box='free' needs a target"),
        ({"pressure": 1e-3, "minimiser": "newton"}, "minimiser='newton' has no effect with pressure=0.001"),
        ({"u0": 1e-8, "evaluations": 7}, "evaluations=7 has no effect with u0=1e-08"),
        ({"accuracy": 1e-9}, "accuracy=1e-09 has no effect without u0"),
        ({"u0": 0.0}, "u0 is 0.0, expected an energy density from 1e-20"),
    ],
)  # fmt: skip
def test_what_has_no_effect_on_a_state_is_refused(given, said):
    with pytest.raises((ValueError, ArgumentError)) as caught:
        js.minimise(square(), progress=False, **given)
    assert said in str(caught.value)


def test_commands(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def run(words):
        done = jamshape(*words.split())
        assert not done.code
        return done.report

    found = run(
        "pack --alpha 0 --n 16 --pressure 1e-4 --box free --stable-to-shear --out packing.h5"
    )
    assert found["pressure"] == pytest.approx(1e-4, rel=1e-8)
    assert found["tries"] == 1
    found = run("minimise packing.h5 --pressure 1e-5 --out other.h5")
    assert found["pressure"] == pytest.approx(1e-5, rel=1e-8)
    found = run("ladder packing.h5 --pressure 1e-5 1e-6 --box free --out ladder.h5")
    assert [state["pressure"] for state in found["states"][1:]] == pytest.approx(
        [1e-5, 1e-6], rel=1e-8
    )
