"""compute contact/local and compute packing: columns, empty packings, order in space, wrong use."""

from __future__ import annotations

import numpy as np
import pytest
from lammps_runs import (
    BONDS,
    global_vector,
    load_plugin,
    loaded,
    local_rows,
    refusal_of,
    run_lmp_well,
    scene,
)
from lammps_scenes import dense, rods, rods_3d, with_odd_ids

pytestmark = pytest.mark.lammps

COLUMNS = BONDS[:-3]


def test_columns_come_in_any_order(tmp_path):
    packing = with_odd_ids(dense(n=32), 2)
    rng = np.random.default_rng(1)
    shuffled = [str(name) for name in rng.permutation(COLUMNS)]
    with loaded(packing, tmp_path, sides="two") as session:
        session.commands(f"""
            compute bonds all contact/local {" ".join(COLUMNS)}
            compute other all contact/local {" ".join(shuffled)} itag itag
            compute one all contact/local dist
            run 0""")
        lmp = session.lmp.numpy
        plain = local_rows(session, "bonds", len(COLUMNS))
        other = lmp.extract_compute("other", 2, 2).copy()
        one = session.lmp.extract_compute("one", 2, 1)[: len(plain)]
    for k, name in enumerate(shuffled):
        np.testing.assert_array_equal(other[:, k], plain[:, COLUMNS.index(name)])
    np.testing.assert_array_equal(other[:, -1], plain[:, 0])
    np.testing.assert_array_equal(one, plain[:, COLUMNS.index("dist")])


def test_no_contact_is_no_row(tmp_path):
    packing = rods([[0, 0], [5, 0]], 0.0, 0.5, 0.5, [20, 20])
    out = run_lmp_well(
        f"""{load_plugin()}
        {scene(packing, tmp_path / "s.data")}
        compute bonds all contact/local itag dist
        compute packing all packing
        dump bonds all local 1 {tmp_path / "bonds"} c_bonds[*]
        thermo_style custom step c_packing[*]
        run 0""",
        tmp_path,
    )
    assert "nan" not in out
    assert (tmp_path / "bonds").read_text().split("ITEM: ENTRIES")[1].split("\n", 1)[1] == ""


def tensor_order(axes):
    """Largest eigenvalue of the nematic tensor, and mean P_4 about its eigenvector."""
    values, vectors = np.linalg.eigh(1.5 * axes.T @ axes / len(axes) - 0.5 * np.eye(3))
    c = axes @ vectors[:, -1]
    return values[-1], np.mean((35 * c**4 - 30 * c**2 + 3) / 8)


@pytest.mark.parametrize("n", [8, 500])
def test_order_in_space(n, tmp_path):
    rng = np.random.default_rng(n)
    cells = np.stack(np.unravel_index(np.arange(n), (8, 8, 8)), axis=1)
    spread = rng.normal(size=(n, 4))
    for quaternion in (spread, [1.0, 0.3, -0.2, 0.5]):
        packing = rods_3d(4.0 * cells - 16.0, quaternion, 1.0, 0.5, [32.0] * 3)
        with loaded(packing, tmp_path) as session:
            session.commands("""
                compute packing all packing
                thermo_style custom step c_packing[1]
                run 0""")
            S_2, S_4 = global_vector(session, "packing")[4:6]
        np.testing.assert_allclose((S_2, S_4), tensor_order(packing.axes), rtol=1e-12)
        if quaternion is not spread:
            np.testing.assert_allclose((S_2, S_4), 1.0, rtol=1e-14)
    assert tensor_order(rods_3d(4.0 * cells, spread, 1.0, 0.5, [32.0] * 3).axes)[0] < 3 / n**0.5


NO_PAIR_STYLE = (
    " found pair_style zero, expected one of jamshape's: use 'pair_style SHAPE/harmonic'."
)


@pytest.mark.parametrize(
    ("command", "sentence"),
    [
        (
            "compute c all contact/local itag nonsense",
            "compute contact/local found column 'nonsense', expected one of: "
            + " ".join(sorted(BONDS))
            + ".",
        ),
        (
            "compute c all contact/local",
            "compute contact/local found no column, expected one or more such as itag.",
        ),
        (
            "group half id 1\ncompute c half contact/local itag",
            "compute contact/local found a group other than all, expected 'all'.",
        ),
        (
            "group half id 1\ncompute c half packing",
            "compute packing found a group other than all, expected 'all'.",
        ),
        ("compute c all packing phi", "compute packing found arguments, expected none."),
        (
            "pair_style zero 1.0\npair_coeff * *\ncompute c all packing\nrun 0",
            "compute packing" + NO_PAIR_STYLE,
        ),
        (
            "pair_style zero 1.0\npair_coeff * *\ncompute c all contact/local itag\nrun 0",
            "compute contact/local" + NO_PAIR_STYLE,
        ),
    ],
)
def test_wrong_use_ends_in_one_sentence(command, sentence, tmp_path):
    packing = rods([[0, 0], [5, 0]], 0.0, 0.5, 0.5, [20, 20])
    assert refusal_of(f"{scene(packing, tmp_path / 's.data')}\n{command}") == sentence
