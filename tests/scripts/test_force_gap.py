"""Contact numbers against the smallest force that counts."""

import numpy as np
import pytest

import jamshape as js

SCRIPT = "marschall_2018/force_gap.py"


def test_bonds_below_the_smallest_force_do_not_count(report, tmp_path):
    for seed in (1, 2):
        particles = js.Spherocylinders(alpha=2)
        js.make_packing(
            particles, n=16, u0=1e-6, seed=seed, progress=False, file=tmp_path / f"{seed}.h5"
        )
    (row,) = report(SCRIPT, tmp_path, "--least", 1e-6, 0.5)["rows"]
    assert (row["alpha"], row["samples"]) == (2, 2)
    expected = []
    for seed in (1, 2):
        packing = js.load(tmp_path / f"{seed}.h5")
        contacts = packing.contacts()
        held = ~packing.rattlers[contacts.pairs].any(axis=1)
        force = np.linalg.norm(contacts.bonds.force, axis=1)
        held = held[contacts.bonds.contact]
        strong = held & (force >= 0.5 * force[held].mean())
        expected.append(
            (packing.z, packing.z_bearing, 2 * strong.sum() / (~packing.rattlers).sum())
        )
    found = [z["value"] for z in row["z"]]
    assert found == pytest.approx(np.mean(expected, axis=0))
    assert found[2] < found[0]


def test_grazing_bonds_are_those_of_the_modes():
    packing = js.make_packing(js.Spherocylinders(alpha=4), n=64, u0=1e-12, seed=2, progress=False)
    counts = packing.contacts().counts
    assert counts.n_grazing == js.modes(packing).table.attributes["n_grazing"] > 0
    assert packing.z_bearing == pytest.approx(
        2 * (counts.n_bonds - counts.n_grazing) / (64 - counts.n_rattlers)
    )
