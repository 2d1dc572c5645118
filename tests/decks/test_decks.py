"""The decks of inputs/ with the stock lmp: what they compute, restarts, ranks, folders, refusals."""

from __future__ import annotations

import os
import re
import shutil
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from deck_runs import INPUTS, LEFT, SMALL, run_deck, start_deck, thermo, words_of
from dumps import read_dump
from lammps_runs import (
    OF_DEBIAN_12,
    QUIET,
    REPOSITORY,
    bare_environment,
    complaints_of,
    start_lmp,
)
from thinned import in_turn, quick

from jamshape.contacts import forces
from jamshape.contacts import network as contacts
from jamshape.files.lammps_text import read_any, read_data, write_data
from jamshape.lammps.plugin import PluginError, built_for, loader_lines, plugin_path
from jamshape.protocols.random_start import random_packing
from jamshape.shapes.particles import Particles

pytestmark = pytest.mark.lammps

SHORT = {"kappa": 1e-2, "phi_end": 0.6, "n": 16, "rows": 20, "frames": 4}
RODS, BODIES, SHEAR = "compress_spherocylinder", "compress_superellipsoid", "shear_spherocylinder"


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folders of complete runs, by deck and number of ranks."""
    made = {}

    def of(name, ranks=1):
        if (name, ranks) not in made:
            made[name, ranks] = tmp_path_factory.mktemp("whole")
            run_deck(name, made[name, ranks], ranks, out="out")
        return made[name, ranks]

    return of


def shape_of(deck):
    return deck.rsplit("_", 1)[1]


def dump_of(deck, path):
    return read_dump(path, shape=shape_of(deck))


def bodies_in(path):
    with pytest.warns(UserWarning, match="does not state the exponents"):
        found = read_data(path, shape="superellipsoid")
    return found.with_(exponent=np.full(found.n, SMALL[BODIES]["p"]))


def said(line):
    return not re.match(r"\s*(#|$)", line)


@pytest.mark.parametrize(
    "path", [*INPUTS.glob("*.in"), *INPUTS.glob("*.lmp")], ids=lambda p: p.name
)
def test_a_deck_is_read_at_a_glance(path):
    lines = [line for line in path.read_text().splitlines() if said(line)]
    assert len(lines) <= (25 if path.name == "load_plugin.lmp" else 45)
    assert not any(re.search(r"\bshell\b|/proc", line) for line in lines)
    assert all(len(line) < 180 for line in lines)


# --- what they compute ----------------------------------------------------------------------------


@pytest.mark.parametrize("name", [RODS, BODIES, SHEAR])
def test_a_deck_leaves_its_files_and_no_others(name, whole):
    assert {path.name for path in whole(name).iterdir()} == {f"out.{end}" for end in LEFT[name]}


def test_rods_are_compressed_from_the_start_of_python_to_the_end(whole):
    rows = thermo(whole(RODS) / "out.log")
    settings = SMALL[RODS]
    step_phi = np.exp(2 * settings["kappa"] * settings["dt"])
    assert rows["phi"][0] == 0.4
    assert 0.95 * (1 - 1e-6) < rows["phi"][-1] < 0.95 * step_phi
    np.testing.assert_allclose(rows["phi"], 0.4 * step_phi ** rows["Step"], rtol=1e-7)
    assert 150 < len(rows["Step"]) < 250
    assert rows["pressure"][0] == 0
    assert rows["pressure"][-1] > 1e-2
    assert rows["z"][-1] > 4
    assert np.isfinite([column for name, column in rows.items() if name != "dt_max"]).all()
    first = dump_of(RODS, whole(RODS) / "out.dump")[0]
    start = random_packing(32, 0.4, 1, Particles.of(alpha=2))
    for name in ("position", "diameters", "species"):
        np.testing.assert_array_equal(getattr(first, name), getattr(start, name))
    np.testing.assert_allclose(first.axes, start.axes, rtol=0, atol=1e-15)


def test_bodies_are_compressed_to_the_end(whole):
    rows, settings = thermo(whole(BODIES) / "out.log"), SMALL[BODIES]
    step_phi = np.exp(3 * settings["kappa"] * 0.5)
    np.testing.assert_allclose(rows["phi"], 0.3 * step_phi ** rows["Step"], rtol=1e-7)
    assert 0.7 * (1 - 1e-6) < rows["phi"][-1] < 0.7 * step_phi
    assert 150 < len(rows["Step"]) < 250
    assert rows["pressure"][0] == 0
    assert rows["pressure"][-1] > 1e-3
    assert rows["z"][-1] > 4
    assert 0 < rows["S_2"].min() < rows["S_2"].max() < 0.6
    assert np.isfinite([column for name, column in rows.items() if name != "dt_max"]).all()


def test_shear_is_at_constant_density_to_its_strain(whole):
    rows = thermo(whole(SHEAR) / "out.log")
    np.testing.assert_allclose(rows["gamma"], np.linspace(0, 0.7, 15), rtol=0, atol=1e-12)
    np.testing.assert_allclose(rows["phi"], rows["phi"][0], rtol=1e-12)
    assert rows["phi"][0] == pytest.approx(0.9, rel=1e-3)
    np.testing.assert_allclose(rows["mu"], rows["sigma"] / rows["pressure"], rtol=1e-6)
    assert rows["rotation"][-1] < 0  # with the vorticity


@pytest.mark.parametrize("name", [RODS, SHEAR])
def test_dumps_of_rods_hold_the_states_that_the_log_shows(name, whole):
    rows, frames = thermo(whole(name) / "out.log"), dump_of(name, whole(name) / "out.dump")
    sides = 2 if SMALL[name].get("sides") == "two" else 1
    assert 15 < len(frames) < 25 if name == RODS else len(frames) == 8
    assert read_any(whole(name) / "out.dump", shape=shape_of(name)).step == frames[-1].step
    tables = (whole(name) / "out.contacts.dump").read_text().split("ITEM: TIMESTEP\n")[1:]
    assert len(tables) == len(frames)
    for frame, text in zip(frames, tables, strict=True):
        found = contacts.forces(frame, k_e=1.0, sides=sides)
        (row,) = np.flatnonzero(rows["Step"] == frame.step)
        np.testing.assert_allclose(rows["pressure"][row], found.pressure, rtol=1e-6)
        np.testing.assert_allclose(rows["u"][row] * frame.box.volume, found.energy, rtol=1e-6)
        network = contacts.find_contacts(frame, sides=sides)
        assert int(text.split()[0]) == frame.step
        lines = text.split("ITEM: ENTRIES ")[1].splitlines()
        assert lines[0].split() == [f"c_contact[{k + 1}]" for k in range(17)]
        pairs = {tuple(map(int, line.split()[:2])) for line in lines[1:]}
        assert pairs == {tuple(sorted(frame.id[pair])) for pair in network.pairs}
        if name == SHEAR:
            tilt = rows["gamma"][row] - (rows["gamma"][row] > 0.5)
            assert frame.box.tilt[0] / frame.box.edges[1] == pytest.approx(tilt, abs=1e-12)


def test_dumps_of_bodies_hold_the_states_that_the_log_shows(whole):
    rows, frames = thermo(whole(BODIES) / "out.log"), dump_of(BODIES, whole(BODIES) / "out.dump")
    assert 15 < len(frames) < 25
    for frame in frames:
        assert frame.shape_style == "superellipsoid"
        assert (frame.exponent == SMALL[BODIES]["p"]).all()
        np.testing.assert_allclose(frame.diameters[0], [2.0, 2.5, 3.0])
        (row,) = np.flatnonzero(rows["Step"] == frame.step)
        np.testing.assert_allclose(rows["phi"][row], frame.phi, rtol=1e-7)
        found = forces(frame)
        np.testing.assert_allclose(rows["pressure"][row], found.pressure, rtol=1e-6, atol=1e-14)
        np.testing.assert_allclose(rows["u"][row] * frame.box.volume, found.energy, rtol=1e-6)


def test_a_second_run_under_the_same_name_begins_anew(whole, tmp_path):
    shutil.copytree(whole(RODS), tmp_path, dirs_exist_ok=True)
    run_deck(RODS, tmp_path, out="out")
    for end in ("dump", "contacts.dump"):
        assert (tmp_path / f"out.{end}").read_bytes() == (whole(RODS) / f"out.{end}").read_bytes()


@pytest.mark.parametrize("name", quick([RODS, BODIES], {RODS}))
def test_two_ranks_agree_until_rounding_has_grown(name, whole):
    one, two = (thermo(whole(name, ranks) / "out.log") for ranks in (1, 2))
    np.testing.assert_array_equal(two["Step"], one["Step"])
    np.testing.assert_allclose(two["phi"], one["phi"], rtol=1e-7)
    early = one["phi"] < {RODS: 0.8, BODIES: 0.6}[name]
    assert (one["pressure"][early] > 0).sum() > 20
    np.testing.assert_allclose(
        two["pressure"][early], one["pressure"][early], rtol=1e-6, atol=1e-12
    )
    starts = [dump_of(name, whole(name, ranks) / "out.dump")[0] for ranks in (1, 2)]
    for field in ("position", "orientation", "diameters", "species"):
        np.testing.assert_array_equal(*(getattr(start, field) for start in starts))


def test_pressure_ends_a_compression(tmp_path):
    run_deck(BODIES, tmp_path, p_end=2e-3, out="out")
    rows = thermo(tmp_path / "out.log")
    assert rows["pressure"][-1] > 2e-3
    assert rows["pressure"][:-2].max() <= 2e-3
    assert rows["phi"][-1] < 0.69
    assert (tmp_path / "out.restart").is_file()
    np.testing.assert_allclose(bodies_in(tmp_path / "out.data").phi, rows["phi"][-1], rtol=1e-7)


def test_a_deck_takes_data_of_ones_own(tmp_path):
    packing = random_packing(16, 0.3, 4, Particles.of(alpha=1))
    write_data(tmp_path / "own.data", packing)
    coefficients = "\nPair Coeffs # spherocylinder/harmonic\n\n1 9\n2 9\n"
    path = tmp_path / "own.data"  # as `write_data` of LAMMPS leaves it
    path.write_text(path.read_text().replace("\nAtoms", f"{coefficients}\nAtoms"))
    run_deck(RODS, tmp_path, data="own.data", kappa=1e-2, phi_end=0.5)
    first = dump_of(RODS, tmp_path / "compress.dump")[0]
    np.testing.assert_array_equal(first.position, packing.position)


@pytest.fixture(scope="module")
def jammed(tmp_path_factory):
    """Folder of superellipsoids well above jamming."""
    folder = tmp_path_factory.mktemp("jammed")
    run_deck(BODIES, folder, phi_end=0.8, out="out")
    return folder


@pytest.mark.parametrize("source", ["restart", "data"])
def test_minimising_balances_forces(source, jammed, tmp_path):
    start = {source: jammed / f"out.{source}", "p": SMALL[BODIES]["p"]}
    run_deck("minimize_superellipsoid", tmp_path, maxiter=1000, out="out", **start)
    rows = thermo(tmp_path / "out.log")
    np.testing.assert_allclose(rows["phi"], thermo(jammed / "out.log")["phi"][-1], rtol=1e-7)
    assert rows["u"][-1] < rows["u"][0]
    assert max(rows["fmax"][-1], rows["tmax"][-1]) < 1e-3
    end = bodies_in(tmp_path / "out.data")
    np.testing.assert_allclose(rows["u"][-1], forces(end).energy / end.box.volume, rtol=1e-6)


# --- restarts -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "ranks"),
    [
        *((name, 1) for name in (RODS, BODIES, SHEAR)),
        (RODS, 2),
        pytest.param(SHEAR, 2, marks=pytest.mark.validate),
    ],
)
def test_a_restart_gives_the_same_bits(name, ranks, whole, tmp_path):
    """From LAMMPS's own restart file; of a tilted box on two ranks to rounding."""
    shutil.copytree(whole(name, ranks), tmp_path, dirs_exist_ok=True)
    files = [tmp_path / f"out.restart.{k}" for k in (1, 2)]
    oldest = min(files, key=os.path.getmtime)
    run_deck(name, tmp_path, ranks, restart=oldest.name, out="again")
    expected = {frame.step: frame for frame in dump_of(name, tmp_path / "out.dump")}
    first, *frames = dump_of(name, tmp_path / "again.dump")
    assert frames[-1].step == max(expected)
    # LAMMPS turns coordinates of a tilted box into fractions and back where it begins.
    at_begin = np.abs(first.position - expected[first.step].position).max()
    assert at_begin <= (1e-14 * first.box.edges.max() if name == SHEAR else 0.0)
    rounding = 1e-12 if name == SHEAR and ranks == 2 else 0.0
    for frame in frames:
        there = expected[frame.step]
        for field in ("position", "orientation", "image"):
            np.testing.assert_allclose(
                getattr(frame, field), getattr(there, field), rtol=0, atol=rounding
            )
        np.testing.assert_array_equal(frame.box.matrix, there.box.matrix)


def test_a_restart_halfway_gives_the_same_bits_and_appends(whole, tmp_path):
    """A run that was ended at its pressure, far from the end of the whole one."""
    run_deck(BODIES, tmp_path, p_end=2e-3, out="out")
    half = thermo(tmp_path / "out.log")
    files = sorted((tmp_path / f"out.restart.{k}" for k in (1, 2)), key=os.path.getmtime)
    run_deck(BODIES, tmp_path, restart=files[-1].name, out="out")
    one, two = thermo(whole(BODIES) / "out.log"), thermo(tmp_path / "out.log")
    assert half["Step"][-1] < 0.95 * one["Step"][-1]
    for name in ("pressure", "u", "phi", "fmax"):
        later = np.isin(two["Step"], one["Step"])
        both = np.isin(one["Step"], two["Step"])
        np.testing.assert_array_equal(two[name][later], one[name][both])
    assert two["Step"][-1] == one["Step"][-1]
    last, expected = (
        dump_of(BODIES, folder / "out.dump")[-1] for folder in (tmp_path, whole(BODIES))
    )
    np.testing.assert_array_equal(last.position, expected.position)


# --- folders --------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def clone(tmp_path_factory):
    """Folder like a clone that was set up."""
    place = tmp_path_factory.mktemp("clone")
    package = place / ".venv" / "lib" / "python3.11" / "site-packages" / "jamshape"
    package.mkdir(parents=True)
    (package / "jamshape_plugin.so").symlink_to(plugin_path())
    shutil.copytree(INPUTS, place / "inputs")
    return place


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """Folder like the one that `jamshape plugin --folder` prints of an installed package."""
    place = tmp_path_factory.mktemp("installed") / "jamshape"
    shutil.copytree(INPUTS, place / "inputs")
    (place / "jamshape_plugin.so").symlink_to(plugin_path())
    return place


@pytest.mark.parametrize(("shape", "ranks"), in_turn(["spherocylinder", "superellipsoid"], [1, 2]))
def test_decks_run_from_the_root_of_a_clone_and_from_elsewhere(shape, ranks, clone, tmp_path):
    compress, minimize = f"compress_{shape}", f"minimize_{shape}"
    bare = SHORT | {"environment": bare_environment}
    folder = clone if ranks == 1 else tmp_path
    place = {"jamshape": "."} if ranks == 1 else {}
    run_deck(compress, folder, ranks, inputs=clone / "inputs", out=f"{tmp_path}/a", **bare, **place)
    run_deck(
        minimize, folder, ranks, inputs=clone / "inputs", out=f"{tmp_path}/b",
        restart=f"{tmp_path}/a.restart", environment=bare_environment, **place,
    )  # fmt: skip
    expected = {f"a.{end}" for end in LEFT[compress]} | {f"b.{end}" for end in LEFT[minimize]}
    assert {path.name for path in tmp_path.iterdir()} == expected
    assert {path.name for path in clone.iterdir()} == {".venv", "inputs"}


def test_a_deck_runs_beside_an_installed_package(installed, tmp_path):
    short = {"kappa": 1e-2, "phi_end": 0.6, "n": 16, "frames": 4}
    run_deck(RODS, tmp_path, inputs=installed / "inputs", environment=bare_environment, **short)
    assert {path.name for path in tmp_path.iterdir()} == {f"compress.{end}" for end in LEFT[RODS]}


def test_a_deck_can_be_read_from_standard_input(tmp_path):
    settings = words_of(**SMALL[BODIES] | {"n": 12, "kappa": 4e-3}, jamshape=REPOSITORY)
    with (INPUTS / f"{BODIES}.in").open() as file:
        done = start_lmp(*QUIET, *settings, cwd=tmp_path, stdin=file)
    assert done.returncode == 0, done.stdout[-3000:]
    assert (tmp_path / "superellipsoid.data").is_file()


def own_deck(folder, lines, ranks=1, **more):
    (folder / "own.in").write_text("\n".join([*lines, 'print "found ${jamshape_plugin}"\n']))
    done = start_lmp("-in", "own.in", cwd=folder, ranks=ranks, env=bare_environment(**more))
    assert "Traceback" not in done.stdout
    found = re.findall("^(?:found|ERROR).*$", done.stdout, re.MULTILINE)
    assert done.returncode == ("ERROR" in found[0])
    return found


READ_BY_ALL = ["plain", "a b", 'a "q"', "[*]#&;`touch X`"]
READ_ONCE = ["$(touch X)${HOME}$n", "it's"]


@pytest.mark.parametrize("name", READ_BY_ALL + READ_ONCE)
def test_two_lines_load_the_plugin_in_a_deck_of_ones_own(name, installed, tmp_path):
    if name in READ_ONCE and built_for() > OF_DEBIAN_12:
        pytest.skip("this LAMMPS reads paths twice, and such ones are refused: see below")
    place = tmp_path / name / "jamshape"
    shutil.copytree(installed, place, symlinks=True)
    lines = loader_lines(place)
    style = "pair_style spherocylinder/harmonic sides one"
    again = ["clear", lines[1], style]
    assert own_deck(tmp_path, [*lines, *lines, style, *again]) == [
        f"found {place / 'jamshape_plugin.so'}"
    ]


@pytest.mark.parametrize(
    ("name", "version"),
    [
        *product(["é", 'it\'s "q"'], [OF_DEBIAN_12, 20250204]),
        *product(READ_ONCE, [20250204, 20250722]),
    ],
)
def test_a_path_that_lammps_cannot_read_in_a_deck_is_refused(name, version):
    with pytest.raises(
        PluginError, match="LAMMPS cannot read in a deck, expected a path of ASCII letters"
    ):
        loader_lines(Path("/home") / name, version)


def test_a_plugin_of_another_place_is_named_by_the_environment(installed, tmp_path):
    (tmp_path / "named.so").symlink_to(plugin_path())
    found = own_deck(tmp_path, loader_lines(installed), JAMSHAPE_PLUGIN=str(tmp_path / "named.so"))
    assert found == [f"found {tmp_path}/named.so"]


@pytest.mark.parametrize("ranks", [1, 2])
def test_no_plugin_is_one_sentence_of_all_ranks(ranks, tmp_path):
    shutil.copytree(INPUTS, tmp_path / "inputs")
    [sentence] = own_deck(tmp_path, ["include inputs/load_plugin.lmp"], ranks)
    assert sentence == (
        "ERROR: Found no jamshape_plugin.so in ., expected the folder that jamshape plugin "
        "--folder prints: add -var jamshape FOLDER."
    )


def test_a_cleared_deck_without_the_folder_finds_no_plugin(installed, tmp_path):
    shutil.copytree(INPUTS, tmp_path / "inputs")
    lines = loader_lines(installed)
    cleared = ["clear", "variable jamshape delete", "include inputs/load_plugin.lmp"]
    [sentence] = own_deck(tmp_path, [*lines, *cleared])
    assert sentence.startswith("ERROR: Found no jamshape_plugin.so in ., expected the folder")


def test_what_is_no_plugin_is_refused(installed, tmp_path):
    text = tmp_path / "text.so"
    text.write_text("text")
    [sentence] = own_deck(tmp_path, loader_lines(installed), JAMSHAPE_PLUGIN=str(text))
    assert sentence.startswith("ERROR: Found a plugin that this LAMMPS cannot load (")


@pytest.mark.parametrize("ranks", [1, pytest.param(2, marks=pytest.mark.validate)])
def test_the_deck_of_the_page_runs_word_for_word(ranks, clone, tmp_path):
    text = (REPOSITORY / "docs" / "how-to" / "decks.md").read_text(encoding="utf-8")
    [deck] = [block for block in text.split("```") if "create_random spherocylinder" in block]
    assert deck.count("/home/you/jamshape") == 1
    (tmp_path / "rods.in").write_text(deck.replace("/home/you/jamshape", str(clone)))
    done = start_lmp("-in", "rods.in", cwd=tmp_path, ranks=ranks, env=bare_environment())
    assert done.returncode == 0, done.stdout[-3000:]
    table = re.search(r"^ *(Step .*)\n(.*)\n(.*)\nLoop time", done.stdout, re.MULTILINE).groups()
    column = {name: k for k, name in enumerate(table[0].split())}
    before, after = (np.array(row.split(), float) for row in table[1:])
    assert before[column["Press"]] == 0
    assert after[column["Press"]] > 1e-2
    shrunk = np.exp(-2 * 1e-3 * 4000 * 0.1)
    assert after[column["Volume"]] == pytest.approx(before[column["Volume"]] * shrunk, rel=1e-7)


# --- refusals -------------------------------------------------------------------------------------

CASES = [
    (RODS, {"kappa": 0}, "Divide by 0"),
    (RODS, {"kappa": "nan"}, "nan"),
    (RODS, {"dt": "-0.1"}, "steps to the end, expected one or more"),
    (RODS, {"alpha": "4;touch X"}, r"Illegal variable|Invalid syntax in variable"),
    (RODS, {"alpha": "$(touch X)"}, "Invalid|variable|formula"),
    (RODS, {"alpha": -1}, r"expected diameters of its shape \(a spherocylinder"),
    (RODS, {"n": 0}, "expected N from 1 to 10000000"),
    (RODS, {"seed": -1}, "expected a whole SEED from 0 on"),
    (RODS, {"sides": "three"}, "three.*expected"),
    (RODS, {"phi_start": 0.8}, r"expected a PHI with room for random insertion, which stalled at"),
    (RODS, {"data": "none"}, "Cannot open file none"),
    (RODS, {"kappa": -1e-3}, "steps to the end, expected one or more; choose positive rates"),
    ("shear_spherocylinder", {"gdot": -1e-3}, "steps to the end, expected one or more"),
    (BODIES, {"p": 0.5}, "expected 'form' with a finite number above 0.5"),
    (BODIES, {"w1": "`touch X`"}, r"Illegal variable|Invalid syntax in variable"),
    ("minimize_spherocylinder", {}, "Found no state to minimise, expected -var restart FILE or -var data FILE"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "settings", "words"), CASES, ids=str)
def test_a_deck_refuses(name, settings, words, tmp_path):
    ranks = 2 if "phi_start" in settings else 1
    done = start_deck(name, tmp_path, ranks, **settings)
    assert done.returncode != 0
    complaints = complaints_of(done)
    assert any(re.search(words, line) for line in complaints), complaints
    assert not (tmp_path / "X").exists()
    assert not list(tmp_path.glob("*.dump"))
