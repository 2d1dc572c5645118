"""inputs/compress_superellipsoid.in, with the stock lmp, as its users run it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from jamshape.files.lammps_text import read_data, read_dump

sys.path.append(str(Path(__file__).parents[1] / "styles"))

from lammps_scenes import REPOSITORY, command_line, environment, nearest_image
from superellipsoid_scenes import sums

pytestmark = pytest.mark.lammps

# Fast and coarse; ends at phi_end, or where the pressure says so.
SETTINGS = {"n": 24, "p": 1.5, "kappa": 4e-4, "w1": 0.8, "w2": 1.2, "phi_end": 0.7, "p_end": 1.0}
COLUMNS = ["step", "phi", "p", "u", "z", "S_2", "C_4", "fmax", "tmax", "dt_max"]


def run_deck(out, ranks=1, deck="compress", **settings):
    settings = {**SETTINGS, **settings} if deck == "compress" else settings
    variables = [word for name, value in {**settings, "out": out}.items()
                 for word in ("-var", name, value)]  # fmt: skip
    done = subprocess.run(
        command_line("-in", f"inputs/{deck}_superellipsoid.in", *variables, ranks=ranks),
        cwd=REPOSITORY, env=environment(), text=True, stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:]


def thermo_rows(out):
    """Columns of the thermo output of the compression, by name; of rows that stand twice the last."""
    rows, is_wanted = {}, False
    for line in (Path(out) / "log.lammps").read_text().splitlines():
        words = line.split()
        if words[:1] == ["Step"]:
            is_wanted = len(words) == len(COLUMNS)
        elif is_wanted and len(words) == len(COLUMNS) and words[0].isdigit():
            rows[int(words[0])] = [float(word) for word in words]
        elif not line.startswith("Fix halt"):
            is_wanted = False
    table = np.array([rows[step] for step in sorted(rows)])
    return dict(zip(COLUMNS, table.T, strict=True))


def frames(out):
    return read_dump(out / "particles.dump")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of one complete run."""
    out = tmp_path_factory.mktemp("whole") / "new" / "folder"
    run_deck(out)
    return out


def test_deck_runs_from_a_dilute_random_state_to_the_end(whole):
    rows = thermo_rows(whole)
    step_phi = np.exp(3 * SETTINGS["kappa"] * 0.5)
    np.testing.assert_allclose(rows["phi"], 0.4 * step_phi ** rows["step"], rtol=1e-7)
    assert 0.7 * (1 - 1e-6) < rows["phi"][-1] < 0.7 * step_phi
    assert 150 < len(rows["step"]) < 250
    assert rows["p"][0] < 1e-5
    assert rows["p"][-1] > 1e-3
    assert rows["z"][-1] > 4
    assert 0 < rows["S_2"].min() < rows["S_2"].max() < 0.6
    assert np.isfinite([column for name, column in rows.items() if name != "dt_max"]).all()
    left = {"initial.data", "log.lammps", "particles.dump", "contacts.dump"}
    assert {path.name for path in whole.iterdir()} == left | {"final.restart", "final.data"}


def test_dump_tells_what_the_particles_are(whole):
    for packing in frames(whole):
        assert packing.shape_style == "superellipsoid"
        assert (packing.exponent == SETTINGS["p"]).all()


def test_dump_holds_the_states_that_the_log_tells_of(whole):
    rows, packings = thermo_rows(whole), frames(whole)
    assert 15 < len(packings) < 25
    for packing in packings:
        (row,) = np.flatnonzero(rows["step"] == packing.step)
        np.testing.assert_allclose(packing.diameters[0], [2.0, 2.5, 3.0])
        np.testing.assert_allclose(rows["phi"][row], packing.phi, rtol=1e-7)
        found = sums(packing, 1.0)
        pressure = np.trace(found["virial"]) / (3 * packing.box.volume)
        np.testing.assert_allclose(rows["p"][row], pressure, rtol=1e-6, atol=1e-14)
        np.testing.assert_allclose(rows["u"][row] * packing.box.volume, found["energy"], rtol=1e-6)
    titles = [line for line in (whole / "particles.dump").read_text().splitlines()
              if line.startswith("ITEM: ATOMS")]  # fmt: skip
    roundness = "SuperquadricRoundness.Phi SuperquadricRoundness.Theta"
    columns = (
        f"id type x y z quatw quati quatj quatk shapex shapey shapez exponent {roundness} ix iy iz"
    )
    assert {title.strip() for title in titles} == {f"ITEM: ATOMS {columns}"}


def test_pressure_ends_the_run(whole, tmp_path):
    run_deck(tmp_path, data=whole / "initial.data", p_end=2e-3)
    rows = thermo_rows(tmp_path)
    assert rows["p"][-1] > 2e-3
    assert rows["p"][:-2].max() <= 2e-3
    assert rows["phi"][-1] < 0.69
    assert (tmp_path / "final.restart").is_file()
    with pytest.warns(UserWarning, match="does not say the exponents"):
        jammed = read_data(tmp_path / "final.data", shape="superellipsoid")
    phi = jammed.with_(exponent=np.full(jammed.n, SETTINGS["p"])).phi
    np.testing.assert_allclose(phi, rows["phi"][-1], rtol=1e-7)


def test_two_ranks_agree_until_rounding_has_grown(whole, tmp_path):
    run_deck(tmp_path, ranks=2, data=whole / "initial.data")
    one, two = thermo_rows(whole), thermo_rows(tmp_path)
    np.testing.assert_array_equal(two["step"], one["step"])
    np.testing.assert_allclose(two["phi"], one["phi"], rtol=1e-7)
    early = one["phi"] < 0.6
    assert (one["p"][early] > 0).sum() > 20
    np.testing.assert_allclose(two["p"][early], one["p"][early], rtol=1e-6, atol=1e-12)


def test_run_goes_on_from_a_restart_file(whole, tmp_path):
    """From where a run ended at a lower pressure."""
    half, rest = tmp_path / "half", tmp_path / "rest"
    run_deck(half, data=whole / "initial.data", p_end=1e-2)
    run_deck(rest, restart=half / "final.restart")
    one, two = thermo_rows(whole), thermo_rows(rest)
    later = np.isin(one["step"], two["step"])
    assert 5 < later.sum() < 100
    np.testing.assert_array_equal(two["step"], one["step"][later])
    np.testing.assert_allclose(two["p"], one["p"][later], rtol=1e-6)
    last, expected = frames(rest)[-1], frames(whole)[-1]
    assert last.step == expected.step
    apart = nearest_image(last.position - expected.position, expected.box)
    assert np.abs(apart).max() < 1e-10 * expected.box.edges.max()


@pytest.fixture(scope="module")
def jammed(whole, tmp_path_factory):
    """Folder of a run that went on well above jamming."""
    out = tmp_path_factory.mktemp("jammed")
    run_deck(out, data=whole / "initial.data", phi_end=0.8)
    return out


@pytest.mark.parametrize("source", ["restart", "data"])
def test_minimising_its_end_balances_forces(source, jammed, tmp_path):
    start = {"restart": {"restart": jammed / "final.restart"},
             "data": {"data": jammed / "final.data", "p": SETTINGS["p"]}}  # fmt: skip
    run_deck(tmp_path, deck="minimize", maxiter=3000, **start[source])
    lines = [line.split() for line in (tmp_path / "log.lammps").read_text().splitlines()]
    begin = lines.index(["Step", "v_phi", "v_u", "v_pressure", "v_z", "v_fmax", "v_tmax"]) + 1
    rows = np.array([line for line in lines[begin:] if len(line) == 7 and line[0].isdigit()], float)
    phi, u, fmax, tmax = rows[:, [1, 2, 5, 6]].T
    np.testing.assert_allclose(phi, thermo_rows(jammed)["phi"][-1], rtol=1e-7)
    assert u[-1] < u[0]
    assert max(fmax[-1], tmax[-1]) < 1e-3
    with pytest.warns(UserWarning, match="does not say the exponents"):
        end = read_data(tmp_path / "final.data", shape="superellipsoid")
    end = end.with_(exponent=np.full(end.n, SETTINGS["p"]))
    np.testing.assert_allclose(u[-1], sums(end, 1.0)["energy"] / end.box.volume, rtol=1e-6)
