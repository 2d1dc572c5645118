"""Contact numbers and bands without bonds that graze."""

import pytest

SCRIPT = "marschall_2018/grazing_bonds.py"
HEADER = "file,alpha,u0,n_backbone,n_modes,z,n_grazing,low,middle,high"


def test_a_bond_that_grazes_is_a_mode_of_the_low_band(report, tmp_path):
    # N' = 100 with 300 modes and two translations, and 2 and 4 bonds that graze; z is that of the high band.
    table = tmp_path / "modes.csv"
    rows = [
        "modes/a.h5,4,1e-15,100,302,5.8,2,10,0,290",
        "modes/b.h5,4,1e-15,100,302,5.8,4,10,0,290",
    ]
    # The first of them once more, led to other energies and back.
    rows.append("ladder/a.h5,4,1e-15,100,302,5.8,2,10,0,290")
    table.write_text("\n".join([HEADER, *rows]) + "\n")
    _, row = report(SCRIPT, table)["rows"]
    assert row["folder"] == "modes"
    assert (row["alpha"], row["u0"], row["z"]["samples"]) == (4, 1e-15, 2)
    assert row["z"]["value"] == 5.8
    assert row["z_without"]["value"] == pytest.approx(5.8 - 0.06)
    assert row["low_without"]["value"] == pytest.approx(13 / 300)
    assert row["low_without"]["error"] == pytest.approx(1 / 300)
    assert row["high_without"]["value"] == pytest.approx(287 / 300)


@pytest.mark.parametrize(
    ("text", "said"), [(HEADER, "no row"), ("file,alpha,u0\na.h5,1,1e-15", "no z")]
)
def test_another_table_is_refused(problem, tmp_path, text, said):
    table = tmp_path / "packings.csv"
    table.write_text(f"{text}\n")
    assert f"packings.csv has {said}, expected modes.csv" in problem(SCRIPT, table)
