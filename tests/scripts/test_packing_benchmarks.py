"""analysis/benchmarks/packings.py, packing_profile.py, packing_threads.py, iteration_cost.py and peer_packings.py."""

import json
import sys

import pytest


def rows_of(capsys):
    return json.loads(capsys.readouterr().out.splitlines()[-1])


@pytest.fixture
def kept(tmp_path):
    """Rows of packings that took a millisecond times the square of N, but for one that was not done."""
    for n, seed in ((64, 1), (64, 2), (256, 1)):
        row = {"case": "discs", "n": n, "seed": seed, "outcome": "converged", "seconds": 1e-3 * n**2,
               "residual": 1e-9, "phi_J": 0.84, "z": 4.0, "n_contacts": 2 * n - 1, "n_rattlers": 0}  # fmt: skip
        (tmp_path / f"discs_n{n}_seed{seed}.json").write_text(json.dumps(row))
    row = {"case": "rods-1", "n": 64, "seed": 1, "outcome": "not done", "seconds": 7.0}
    (tmp_path / "rods-1_n64_seed1.json").write_text(json.dumps(row))
    return tmp_path


def test_kept_packings_are_told_of_and_none_is_made(here, kept, capsys):
    before = sorted(kept.iterdir())
    sizes = ("--n", 64, 256, 1024, "--seeds", 5)
    assert not here("benchmarks/packings.py", "--kept", "--out", kept, *sizes)
    out = capsys.readouterr().out
    assert sorted(kept.iterdir()) == before
    assert "| discs | 64 | 4.1 (4.1 to 4.1) |" in out
    assert "1 not done" in out
    found = json.loads(out.splitlines()[-1])
    assert len(found["rows"]) == 4
    (growth,) = found["growths"]
    assert growth["case"] == "discs"
    assert growth["power"] == pytest.approx(2)
    assert growth["local"] == pytest.approx([2])


@pytest.mark.parametrize("shape", [("--alpha", 1), ("--superellipsoid", 1, 1, 1)])
def test_parts_of_a_packing_add_up(here, capsys, shape):
    here("benchmarks/packing_profile.py", *shape, "--n", 16)
    found = rows_of(capsys)
    parts = found["parts"]
    assert found["outcome"] in {"converged", "sliding"}
    assert sum(part["seconds"] for part in parts.values()) == pytest.approx(found["seconds"])
    assert parts["steps below jamming"]["evaluations"] > 100
    assert parts["to u0"]["minimisations"] > 1
    assert parts["to u0"]["factorisations"] > 1
    assert parts["the rest"]["seconds"] > 0


def test_threads_are_told_beside_one(here, capsys):
    here("benchmarks/packing_threads.py", "--n", 64, "--threads", 2, 3, "--rounds", 2)
    found = rows_of(capsys)
    assert found["threads"] == [1, 2, 3]
    for name in ("evaluation", "factorisation"):
        assert found[name]["by_clock"][0] == found[name]["asking"][0] == 1
        assert len(found[name]["by_clock"]) == 3


@pytest.mark.lammps
def test_an_iteration_is_timed_beside_the_pair_style_and_an_older_version(here, capsys, tmp_path):
    # In smaller packings calls from Python take as long as the particles.
    some = ("--cases", "discs", "--n", 256, "--rounds", 1, "--work", tmp_path)
    here("benchmarks/iteration_cost.py", *some, "--against", sys.executable)
    found = rows_of(capsys)
    assert set(found) == {"discs", "discs before"}
    for row in found.values():
        assert min(row.values()) > 0
        assert row["with factors"] > row["solution"]
        assert row["iteration"] > row["evaluation"]
        ratio = row["iteration"] / row["pair style"]
        assert row["iteration over pair style"] == pytest.approx(ratio)


PEER = """
import sys, types
module = types.ModuleType("spheropack")
class Found:
    density, status = 0.84, "jammed"
module.pack = lambda **settings: Found()
module.Box = list
module.stop = types.SimpleNamespace(Jammed=lambda step: step)
module.analysis = types.SimpleNamespace(isostaticity=lambda found: 0.98)
sys.modules["spheropack"] = module
"""


def test_packings_are_timed_beside_those_of_a_peer(here, capsys, tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(PEER)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{':'.join(sys.path)}")
    out = tmp_path / "out"
    some = (
        "--cases",
        "discs",
        "--n",
        16,
        "--seeds",
        1,
        "--spheropack",
        sys.executable,
        "--out",
        out,
    )
    here("benchmarks/peer_packings.py", *some)
    ours, peer = rows_of(capsys)["rows"]
    assert (ours["maker"], peer["maker"]) == ("jamshape", "spheropack")
    assert (peer["phi"], peer["contacts"], peer["outcome"]) == (0.84, 0.98, "jammed")
    assert ours["contacts"] == pytest.approx(1, abs=0.1)
