"""LAMMPS's own minimisers relax positions and orientations together."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_scenes import (
    SIDES,
    angle_between,
    bindings_forces,
    dense,
    dense_mixture,
    difference_from_bindings,
    error_of,
    kicked,
    load_plugin,
    loaded,
    run_lmp,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
    dump,
)

from jamshape import contacts

pytestmark = pytest.mark.lammps

SCENES = {
    "rods": lambda: dense(n=32, phi=0.9),
    "mixture": lambda: dense_mixture(n=32, phi=0.9),
    "nearly discs": lambda: dense(alpha=0.1, n=32, phi=0.88),
    "discs": lambda: dense(alpha=0.0, n=32, phi=0.88),
    "rods 3d": lambda: dense(3, alpha=2.0, n=32, phi=0.72),
    "mixture 3d": lambda: dense_mixture(3, n=32, phi=0.72),
}


def residuals(state):
    """Largest net force and torque over the mean bond force (times the half extent)."""
    network = contacts.find_contacts(state.exact, sides=2)
    scale = np.linalg.norm(network.bonds.force, axis=1).mean()
    force = np.linalg.norm(state.force, axis=1)
    torque = np.linalg.norm(state.torque.reshape(state.packing.n, -1), axis=1)
    reach = state.packing.diameters[:, 0] / 2
    return force.max() / scale, (torque / reach).max() / scale


@pytest.mark.parametrize("style", ["cg", "sd"])
@pytest.mark.parametrize("name", SCENES)
def test_minimise_relaxes_positions_and_orientations(name, style, tmp_path, measured):
    packing = SCENES[name]()
    iterations = {"cg": 3000, "sd": 300}[style]
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands("run 0")
        start = state_of(session)
        energy_start = session.lmp.get_thermo("pe")
        session.commands(f"""
            min_style {style}
            min_modify dmax 0.05
            minimize 0.0 1e-14 {iterations} {20 * iterations}""")
        energy = session.lmp.get_thermo("pe")
        session.commands("run 0")
        end = state_of(session)
    before, after = residuals(start), residuals(end)
    turned = angle_between(start.quaternion, end.quaternion).max()
    measured(energy=energy / energy_start, force=after[0], torque=after[1], turned=turned)
    np.testing.assert_allclose(energy, bindings_forces(end, "two").energy, rtol=1e-12)
    assert difference_from_bindings(end, "two") < 1e-13
    assert energy < 0.9 * energy_start
    if style == "cg":
        assert after[0] < 1e-3 * before[0]
    if name not in ("discs",):
        assert turned > 1e-3
        if style == "cg":
            assert after[1] < 1e-3 * before[1]
    else:
        assert turned == 0.0
