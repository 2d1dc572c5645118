"""Packings of two species with stiffnesses of their own, from a start to modes, runs and LAMMPS's files."""

import numpy as np
import pytest

import jamshape as js
from jamshape.checks import TimeLimitError
from jamshape.commands.contents import contents_of
from jamshape.commands.info import lines_of
from jamshape.files.h5md import read_packing, write_run
from jamshape.lammps.session import Session
from jamshape.landscape import Landscape, State
from jamshape.protocols.random_start import random_packing
from jamshape.vibration.table import read_modes

K_E = ((1.0, 2.0), (2.0, 4.0))


def crowd(n=30, k_e=K_E, seed=3, **parameters):
    """Rods at random, pressed together."""
    random = random_packing(n, 0.6, seed, js.Spherocylinders(alpha=1), 2)
    edges = random.box.edges * (0.6 / 0.95) ** 0.5
    return js.Packing.of(
        "spherocylinder", random.position * (0.6 / 0.95) ** 0.5, random.orientation, box=edges,
        diameters=random.diameters, species=1 + np.arange(n) % 2, k_e=k_e, **parameters,
    )  # fmt: skip


@pytest.fixture(scope="module")
def rested():
    return js.minimise(crowd(), strict=True, progress=False)


def test_a_mixture_is_minimised_and_its_modes_are_those_of_its_energy(rested):
    assert rested.results["outcome"] == "converged"
    assert rested.law == js.Interaction(K_E, 2)
    found = js.energy(rested, hessian=True, rotation="half_length")
    assert found.net_force < 1e-7
    assert js.energy(rested.with_(law=js.Interaction(1.0))).net_force > 1e-2  # of other forces
    modes = js.modes(rested)
    landscape, state, h = Landscape(rested), State.of(rested), 1e-6
    columns = []
    for d in np.eye(landscape.size):
        ahead, behind = (landscape.evaluate(landscape.displaced(state, s * d)).gradient for s in (h, -h))  # fmt: skip
        columns.append((ahead - behind) / (2 * h))
    dense = np.array(columns)
    expected = np.linalg.eigvalsh((dense + dense.T) / 2)
    held = modes.eigenvalues
    free = 3 * rested.n - len(held)  # of rattlers
    assert free == 0 or rested.n_rattlers
    largest = expected[-len(held) :][-20:]
    np.testing.assert_allclose(np.sort(held)[-20:], largest, rtol=1e-6)


def test_other_stiffnesses_are_other_minima(rested):
    one = js.minimise(crowd(k_e=1.0), progress=False)
    assert one.u < rested.u < 4 * one.u


def test_runs_keep_it(rested, tmp_path):
    run = js.quasistatic_shear(start=rested, step=1e-3, strain=2e-3, progress=False, file=tmp_path / "aqs.h5")  # fmt: skip
    assert run.packing().law == rested.law
    for at in (0, -1):
        assert run["u"][at] == pytest.approx(run.packing(at).u, rel=1e-8)
    assert run["u"][0] == pytest.approx(rested.u, rel=1e-8)
    slow = js.shear(
        start=rested, gdot=1e-5, strain=2e-3, integrator="sdirk2", rows=2, progress=False,
        file=tmp_path / "slow.h5",
    )  # fmt: skip
    last = slow.packing()
    assert last.law == rested.law
    assert slow["u"][-1] == pytest.approx(last.u, rel=1e-6)


def test_the_shear_modulus_is_the_slope_of_the_stress(rested):
    run = js.quasistatic_shear(start=rested, step=1e-7, strain=2e-7, progress=False)
    slope = (run["p_xy"][-1] - run["p_xy"][0]) / 2e-7
    found = js.modes(rested).moduli.simple_shear.relaxed
    assert -slope == pytest.approx(found, rel=1e-3)


@pytest.mark.lammps
@pytest.mark.parametrize("integrator", ["heun", "sdirk2"])
def test_a_run_that_was_stopped_goes_on_with_it(rested, tmp_path, integrator):
    def sheared(name, **more):
        return js.shear(
            start=rested, gdot=1e-3, strain=0.2, integrator=integrator, rows=50,
            file=tmp_path / name, progress=False, **more,
        )  # fmt: skip

    whole = sheared("whole.h5")
    with pytest.raises(TimeLimitError):
        sheared("stopped.h5", seconds=1e-6)
    again = sheared("stopped.h5")
    np.testing.assert_array_equal(again["u"], whole["u"])
    assert again.packing().law == whole.packing().law == rested.law


@pytest.mark.lammps
def test_a_run_in_lammps_has_it(rested, tmp_path):
    def sheared(**more):
        return js.shear(
            start=rested, gdot=1e-3, strain=2e-3, integrator="heun", rows=2, frames=2,
            file=tmp_path / "shear.h5", progress=False, **more,
        )  # fmt: skip

    run = sheared()
    assert run["u"][0] == pytest.approx(rested.u, rel=1e-9)
    last = run.packing()
    assert last.law == rested.law
    assert run["u"][-1] == pytest.approx(last.u, rel=1e-9)
    assert sheared()["u"][-1] == run["u"][-1]  # loaded
    other = rested.with_(law=js.Interaction(1.0, 2))
    with pytest.raises(ValueError, match=r"shear\.h5 holds a shear with k_e"):
        js.shear(
            start=other, gdot=1e-3, strain=2e-3, integrator="heun", rows=2, frames=2,
            file=tmp_path / "shear.h5", progress=False,
        )  # fmt: skip


@pytest.mark.lammps
def test_lammps_reads_it_from_our_data_file(rested, tmp_path):
    js.save(tmp_path / "rested.data", rested)
    with Session() as session:
        session.commands(f"""
            units lj
            dimension 2
            atom_style ellipsoid
            pair_style spherocylinder/harmonic sides two
            read_data {tmp_path}/rested.data
            neighbor 0.3 bin
            thermo_modify norm no
            run 0 post no
        """)
        U = session.lmp.get_thermo("pe")
        session.commands(f"write_data {tmp_path}/again.data pair ij")
    assert pytest.approx(rested.u * rested.box.volume, rel=1e-11) == U
    assert js.load(tmp_path / "again.data", dimension=2).law == rested.law


def test_info_and_files_of_modes_state_it(rested, tmp_path):
    js.save(tmp_path / "rested.h5", rested)
    lines = lines_of(contents_of(tmp_path / "rested.h5"))
    assert "contacts:    k_e 1.0,2.0;2.0,4.0" in lines
    js.modes(rested).save(tmp_path / "modes.h5")
    table = read_modes(tmp_path / "modes.h5")
    np.testing.assert_array_equal(table.attributes["packing_k_e"], K_E)


def test_frames_of_a_file_share_a_table_of_many_species(tmp_path):
    """Of more than a kilobyte, which is no attribute but a dataset."""
    own = 1.0 + np.arange(30)
    table = np.add.outer(own, own)
    packing = crowd(k_e=K_E).with_(species=1 + np.arange(30), law=js.Interaction(table))
    write_run(tmp_path / "run.h5", [packing, packing.with_(step=packing.step + 1)])
    assert read_packing(tmp_path / "run.h5").law == packing.law
    assert packing.law.k_e == tuple(map(tuple, table.tolist()))
    other = packing.with_(law=js.Interaction(2.0), step=packing.step + 1)
    with pytest.raises(ValueError, match="law differs from the first frame"):
        write_run(tmp_path / "other.h5", [packing, other])


def test_a_data_file_with_two_answers_is_refused(rested, tmp_path):
    path = tmp_path / "rested.data"
    js.save(path, rested)
    path.write_text(path.read_text().replace("\n1 2 2.0\n", "\n1 2 3.0\n"))
    with pytest.raises(ValueError, match="PairIJ Coeffs differ from k_e in the first line"):
        js.load(path)


@pytest.mark.parametrize(
    ("k_e", "said"),
    [
        ([[1, 2], [3, 4]], r"k_e is \[\[1, 2\], \[3, 4\]\], expected a positive number, or a symmetric"),
        ([[1, -2], [-2, 1]], "expected a positive number, or a symmetric table"),
        ([1, 2], "expected a positive number, or a symmetric table"),
        ([[1, 2], [2]], "expected a positive number, or a symmetric table"),
        ([[1]], "k_e of the law has 1 rows and columns, expected one for each species up to 2"),
    ],
)  # fmt: skip
def test_other_tables_are_refused(k_e, said):
    with pytest.raises(ValueError, match=said):
        crowd(k_e=k_e)
