"""The script that draws shapes of particles, as its users run it."""

import pytest
from pictures import image

SCRIPT = "yuan_2019/fig02_shapes.py"


def test_help(help_of):
    said = help_of(SCRIPT)
    for words in ("Yuan", "--shape", f"python analysis/{SCRIPT}"):
        assert words in said


def test_shapes_of_the_paper(report, tmp_path):
    found = report(SCRIPT, "--out", tmp_path / "shapes.png")["shapes"]
    image(tmp_path / "shapes.png")
    assert len(found) == 9
    assert found[0]["asphericity"] == pytest.approx(0.23836588)  # 1 - Eq. 8 at beta = 0.3
    assert found[1]["asphericity"] == pytest.approx(0.15390245)  # 1 - Eq. 9 at beta = 3
    assert found[2]["beta"] == pytest.approx(1)
    assert (tmp_path / "shapes.png").stat().st_size < 300_000


def test_shape_of_choice(report, tmp_path):
    out = tmp_path / "one.png"
    (found,) = report(SCRIPT, "--shape", 1, 1, 1, "--out", out, "--dpi", 150)["shapes"]
    pixels = image(out)
    assert found["asphericity"] == pytest.approx(0, abs=1e-14)
    colored = pixels[..., :3].max(axis=2) - pixels[..., :3].min(axis=2) > 0.15
    assert 0.05 < colored.mean() < 0.5


def test_what_is_no_shape_is_said(problem, tmp_path):
    out = tmp_path / "none.png"
    said = problem(SCRIPT, "--shape", 1, 2, 1, "--out", out)
    assert "w1 = 2.0" in said
    assert "expected 0 < w1 <= 1 <= w2" in said
    said = problem(SCRIPT, "--shape", 0.3, 1, 1, "--out", out)
    assert "p is 0.3, expected at least 1/2" in said
