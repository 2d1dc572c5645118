import numpy as np
import pytest

from common.mode_tables import (
    Wanted,
    band_means,
    pick_modes,
    pooled,
    read_tables,
    seed_of,
    selected,
    sizes,
    stable,
    unstable,
)
from jamshape.vibration.ensembles import key_of
from jamshape.vibration.hessian import Coordinates
from jamshape.vibration.table import ModeTable, write_modes

N = 4
VALUES = np.array([0.0, 0.0, -4e-8, 1e-8, 9e-8, 1e-4, 4e-4, 0.25, 1.0, 4.0])
BAND = np.array([-1, -1, 0, 0, 0, 1, 1, 2, 2, 2])


def table(dimension=2, **packing):
    """A table of modes with known eigenvalues."""
    k = len(VALUES)
    zero = np.zeros(k)
    columns = {
        "eigenvalues": VALUES,
        "omega": np.sign(VALUES) * np.sqrt(np.abs(VALUES)),
        "sign": np.sign(VALUES).astype(np.int64),
        "is_translation": BAND == -1,
        "participation": np.arange(k) / k,
        "band": BAND,
    }
    rest = ("solver_error", "entry_error", "overlap_error", "state_error", "of_round")
    rest += ("parallel", "perpendicular", "rotation")
    columns |= dict.fromkeys(rest, zero)
    size = 3 * N
    coordinates = Coordinates(
        np.repeat(np.arange(N), 3),
        np.tile(np.arange(3), N),
        np.tile(np.eye(3), (N, 1)),
        N,
        dimension,
    )
    known = {"seed": 1, "n": N, "shape": "spherocylinder"} | packing
    attributes = {f"packing_{name}": value for name, value in known.items()}
    return ModeTable(columns, np.empty((size, 0)), coordinates, np.empty(0), attributes)


def test_system_and_energy_of_modes():
    rods = key_of(table(alpha=4.0, u0=1e-15))
    assert (rods.system.shape, rods.system.dimension) == ("spherocylinder", 2)
    assert (rods.number("alpha"), rods.number("u0")) == (4.0, 1e-15)
    known = {"exponent": 1.5, "w1": 1.0, "w2": 1.0, "protocol": "yuan-2019-1"}
    bodies = key_of(table(3, shape="superellipsoid", **known))
    assert bodies.number("exponent") == 1.5
    assert (bodies.u0, bodies.system.protocol) == (0.0, "yuan-2019-1")
    assert key_of(table(alpha=1.0, shape="superellipsoid")).system.parameters == ()
    assert seed_of(table(seed=7)) == 7
    shapeless = table(alpha=4.0)
    del shapeless.attributes["packing_shape"]
    with pytest.raises(ValueError, match="do not state the shape"):
        key_of(shapeless)


def test_files_are_grouped_and_selected(tmp_path):
    for alpha in (1.0, 4.0):
        for u0 in (1e-12, 1e-15):
            for seed in (2, 1):
                path = tmp_path / f"{alpha}_{u0}_{seed}.h5"
                write_modes(path, table(alpha=alpha, u0=u0, seed=seed), {}, vectors=False)
    (tmp_path / "other.h5").write_text("no modes")
    tables = read_tables([tmp_path])
    assert [(key.number("alpha"), key.u0) for key in tables] == [
        (1.0, 1e-15), (1.0, 1e-12), (4.0, 1e-15), (4.0, 1e-12),
    ]  # fmt: skip
    assert [seed_of(t) for t in next(iter(tables.values()))] == [1, 2]
    assert len(selected(selected(tables, "alpha", [4.0]), "u0", [1e-12])) == 1
    assert selected(tables, "alpha", []) is tables
    with pytest.raises(ValueError, match="no modes have alpha = 7, expected one of 1, 4"):
        selected(tables, "alpha", [7.0])
    path = tmp_path / "larger.h5"
    write_modes(path, table(alpha=1.0, n=9), {}, vectors=False)
    with pytest.raises(ValueError, match="n is 4 and 9, expected one ensemble"):
        read_tables([tmp_path])


def test_modes_of_either_sign():
    t = table()
    assert np.flatnonzero(stable(t)).tolist() == [3, 4, 5, 6, 7, 8, 9]
    assert np.flatnonzero(unstable(t)).tolist() == [2]
    assert pooled([t, t], sizes, unstable) == pytest.approx([2e-4, 2e-4])
    means = band_means([t, t], "participation")
    assert means["middle"].value == pytest.approx(0.55)
    assert means["middle"].samples == 2


def test_modes_are_picked_by_number_frequency_or_band():
    t = table()
    assert pick_modes(t, Wanted(numbers=[3, 1])) == [3, 1]
    assert pick_modes(t, Wanted(omegas=[0.45, -1.0, 1e-9])) == [7, 2, 3]
    assert pick_modes(t, Wanted(per_band={"low": 1, "middle": 1, "high": 2})) == [2, 6, 7, 9]
    with pytest.raises(ValueError, match="no mode 99, expected one from 0 to 9"):
        pick_modes(t, Wanted(numbers=[99]))
