"""Names of 0.1.0 are accepted for one release, with a warning that gives the new one."""

import subprocess
import sys

import pytest

import jamshape as js
from jamshape.files.h5md import read_attributes
from jamshape.old_names import current


def test_old_names_of_arguments_and_values_warn_and_work(tmp_path):
    rods = js.Spherocylinders(alpha=1)
    file, few = tmp_path / "packing.h5", {"n": 8, "u0": 1e-6, "progress": False}
    with pytest.warns(
        FutureWarning, match="^way is called protocol now; the old name goes"
    ) as said:
        js.make_packing(rods, way="steps", file=file, **few)
    assert [one.filename for one in said] == [__file__]  # it points at the caller
    assert js.make_packing(rods, protocol="steps", file=file, **few).n == 8
    with (
        pytest.warns(FutureWarning),
        pytest.raises(ValueError, match="does not apply to the protocol steps"),
    ):
        js.make_packing(rods, protocol="steps", search="halving", **few)
    with pytest.warns(FutureWarning, match="^tolerance is called integration_tolerance now"):
        js.slow_compress(rods, n=8, phi=(0.6, 0.61), kappa=1e-3, tolerance=1e-2, progress=False)


def test_the_old_name_of_the_class_warns_and_is_the_new_one():
    said = "^MeasuredPacking is called Packing now; the old name goes"
    with pytest.warns(FutureWarning, match=said) as warned:
        assert js.MeasuredPacking is js.Packing
    assert warned[0].filename == __file__


@pytest.mark.parametrize(
    ("name", "old", "new"),
    [
        ("search", "direct", "extrapolation"),
        ("search", "halving", "bisection"),
        ("minimiser", "paper", "cg_marschall"),
    ],
)
def test_old_values_warn(name, old, new):
    with pytest.warns(FutureWarning, match=f"^{name} '{old}' is called '{new}' now"):
        assert current(name, old) == new
    assert current(name, new) == new


def test_both_names_at_once_are_refused():
    with pytest.raises(
        ValueError, match=r"^way is an old name of protocol, which is given as well; leave way out$"
    ):
        js.make_packing(js.Spherocylinders(alpha=1), way="steps", protocol="dynamics")


def test_old_options_warn_and_work(tmp_path):
    words = "pack --alpha 1 --n 8 --u0 1e-6 --way steps --out packing.h5"
    done = subprocess.run(
        [sys.executable, "-m", "jamshape", *words.split()],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=True,
    )
    assert (
        "jamshape pack: warning: --way is called --protocol now; the old name goes" in done.stderr
    )
    assert read_attributes(tmp_path / "packing.h5")["n"] == 8
