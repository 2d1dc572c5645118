"""LAMMPS's own minimisers relax positions and orientations together."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_runs import (
    difference_from_library,
    dump,
    global_vector,
    library_forces,
    load_plugin,
    loaded,
    refusal_of,
    run_lmp_well,
    scene,
    state_of,
    states_from_dump,
)
from lammps_scenes import angle_between, dense, dense_mixture, pose_differences
from superellipsoid_scenes import crowd

from jamshape import contacts

pytestmark = pytest.mark.lammps

SCENES = {
    "rods": lambda seed=1: dense(n=32, phi=0.95, seed=seed),
    "short rods": lambda seed=1: dense(alpha=1.0, n=32, phi=0.95, seed=seed),
    "discs": lambda seed=1: dense(alpha=0.0, n=32, phi=0.88, seed=seed),
    "rods 3d": lambda seed=1: dense(3, alpha=2.0, n=16, phi=0.72, seed=seed),
    "mixture 3d": lambda seed=1: dense_mixture(3, n=16, phi=0.72, seed=seed),
}
# Overlaps far above A^2/d for some: their side-to-side contacts have kinks.
NEARLY_ROUND = {
    "alpha 0.1": lambda seed: dense(alpha=0.1, n=32, phi=0.88, seed=seed),
    "mixture": lambda seed: dense_mixture(n=32, phi=0.95, seed=seed),
}


def residuals(state):
    """Largest net force and torque over the mean bond force (times the half extent)."""
    network = contacts.find_contacts(state.packing, sides=2)
    scale = np.linalg.norm(network.bonds.force, axis=1).mean()
    force = np.linalg.norm(state.force, axis=1)
    torque = np.linalg.norm(state.torque.reshape(state.packing.n, -1), axis=1)
    reach = state.packing.diameters[:, 0] / 2
    return force.max() / scale, (torque / reach).max() / scale


def minimised(session, style, iterations, like=None):
    """Energy and state before and after."""
    session.commands("run 0")
    before = session.lmp.get_thermo("pe"), state_of(session, like)
    session.commands(f"""
        min_style {style}
        min_modify dmax 0.05
        minimize 0.0 0.0 {iterations} {20 * iterations}
        run 0""")
    return before, (session.lmp.get_thermo("pe"), state_of(session, like))


@pytest.mark.parametrize("name", SCENES)
def test_cg_relaxes_positions_and_orientations(name, tmp_path, measured):
    """To rounding, unless it stalls in a kink or at LAMMPS's absolute tolerances: in one of three."""
    reached = []
    for seed in (1, 2, 3):
        with loaded(SCENES[name](seed), tmp_path, sides="two") as session:
            (energy_before, start), (energy, end) = minimised(session, "cg", 3000)
        reached.append(max(residuals(end)))
        np.testing.assert_allclose(energy, library_forces(end, "two").energy, rtol=1e-12)
        assert energy < 0.6 * energy_before
        if name == "discs":
            assert end.quaternion.tobytes() == start.quaternion.tobytes()
        else:
            assert angle_between(start.quaternion, end.quaternion).max() > 0.05
    measured(**{f"seed_{k + 1}": value for k, value in enumerate(reached)})
    assert sorted(reached)[1] < 1e-5


@pytest.mark.parametrize(
    ("dimension", "kinds", "phi"),
    [(2, (0, 1, 2, 3), 0.95), (3, (0, 1, 2, 3), 0.78), (3, (1,), 0.78), (3, (2,), 0.8)],
)
def test_cg_relaxes_superellipsoids(dimension, kinds, phi, tmp_path, measured):
    """In two goes: LAMMPS's line search may repeat a step that changes no energy, until it begins anew."""
    packing = crowd(dimension, kinds, n=16, phi=phi, spread=0.3)
    with loaded(packing, tmp_path, k_e=1.7) as session:
        session.commands("""
            compute packing all packing
            thermo_style custom step pe c_packing[1]
            thermo_modify norm no""")
        (before, start), _ = minimised(session, "cg", 2000, packing)
        _, (energy, end) = minimised(session, "cg", 2000, packing)
        force, torque = global_vector(session, "packing")[[6, 12]]
    turned = angle_between(end.quaternion, start.quaternion).max()
    measured(energy=energy / before, force=force, torque=torque, turned=turned)
    assert energy < 0.6 * before
    assert turned > 0.05
    assert max(force, torque) < 1e-3
    np.testing.assert_allclose(energy, library_forces(end, k_e=1.7).energy, rtol=1e-11)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("name", NEARLY_ROUND)
def test_kinks_stall_cg_but_never_raise_the_energy(name, seed, tmp_path, measured):
    with loaded(NEARLY_ROUND[name](seed), tmp_path, sides="two") as session:
        (before, start), (energy, end) = minimised(session, "cg", 500)
    measured(energy=energy / before, residual=max(residuals(end)), before=max(residuals(start)))
    assert energy < 0.9 * before


@pytest.mark.parametrize("dimension", [2, 3])
def test_two_ranks_find_the_same_minimum(dimension, tmp_path, measured):
    packing = SCENES[{2: "rods", 3: "rods 3d"}[dimension]]()
    for ranks in (1, 2):
        run_lmp_well(
            f"""{load_plugin()}
            {scene(packing, tmp_path / "s.data", sides="two")}
            min_style cg
            min_modify dmax 0.05
            minimize 0.0 0.0 3000 60000
            {dump(tmp_path / f"{ranks}.dump")}
            run 0""",
            tmp_path, ranks,
        )  # fmt: skip
    states = [states_from_dump(tmp_path / f"{ranks}.dump")[0] for ranks in (1, 2)]
    one, two = (library_forces(state, "two").energy for state in states)
    measured(energy=two / one - 1, force=max(residuals(state)[0] for state in states))
    assert all(max(residuals(state)) < 1e-8 for state in states)
    # Not the positions: some particles are free to move or to spin. In space the way there is
    # longer, and rounding may lead to the next minimum.
    np.testing.assert_allclose(two, one, rtol={2: 1e-12, 3: 1e-2}[dimension])


def test_other_minimisers_are_refused_for_rods_only(tmp_path):
    for style in ("fire", "quickmin", "hftn"):
        sentence = refusal_of(f"""{scene(SCENES["rods"](), tmp_path / "s.data", sides="two")}
            min_style {style}
            minimize 0.0 0.0 10 100""")
        assert sentence == (
            f"min_style {style} cannot rotate particles: use 'min_style cg' or 'min_style sd', which "
            "relax positions and orientations together."
        )
    with loaded(SCENES["discs"](), tmp_path, sides="two") as session:
        (before, _), (after, _) = minimised(session, "fire", 200)
    assert after < before


@pytest.mark.parametrize("name", ["rods", "rods 3d"])
def test_a_box_that_tilts_relaxes_to_a_pressure(name, tmp_path):
    """Its tilts follow the derivatives of the energy also where torques do not balance yet."""
    with loaded(SCENES[name](), tmp_path, sides="two") as session:
        session.commands("""
            change_box all triclinic
            pair_coeff * * 1e6
            fix relax all box/relax tri 1e4 vmax 0.001
            thermo_style custom step pxx pyy pzz pxy pxz pyz
            min_style cg
            minimize 0.0 0.0 3000 30000""")
        for _ in range(4):  # line searches end at absolute changes of the energy
            session.commands("minimize 0.0 0.0 3000 30000")
        session.commands("run 0")
        keys = (
            ("pxx", "pyy", "pxy") if name == "rods" else ("pxx", "pyy", "pzz", "pxy", "pxz", "pyz")
        )
        found = [session.lmp.get_thermo(key) for key in keys]
    wanted = [1e4 * (key[1] == key[2]) for key in keys]
    np.testing.assert_allclose(found, wanted, rtol=0, atol=10.0)


def test_compression_goes_on_after_a_minimisation(tmp_path):
    """The fix takes up the positions and orientations that the minimiser left."""
    with loaded(SCENES["rods"](), tmp_path, sides="two") as session:
        session.commands("""
            fix drive all overdamped/affine drag 1.0 compress 1e-3
            timestep 0.05
            run 20
            min_style cg
            minimize 0.0 0.0 300 5000
            run 0""")
        found = state_of(session)
        session.commands("run 1")
        after = state_of(session)
    assert difference_from_library(after, "two") < 1e-13
    distance, angle = pose_differences(found, after)
    assert 0 < distance < 1e-3
    assert angle < 1e-3
