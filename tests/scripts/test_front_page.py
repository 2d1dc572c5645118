"""The strip of pictures of the front page: its pictures, their size, and the packings that they show."""

import re
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import jamshape as js

ROOT = Path(__file__).parents[2]
PICTURE = re.compile(r"pictures/(front_\w+\.png)")


def of_few_particles(monkeypatch):
    """Make every packing of an eighth of its particles, which are sheared in ten times larger steps."""
    make, shear = js.make_packing, js.quasistatic_shear
    monkeypatch.setattr(js, "make_packing", lambda shape, n, **more: make(shape, n=n // 8, **more))
    monkeypatch.setattr(js, "quasistatic_shear", lambda step, **more: shear(step=10 * step, **more))


@pytest.mark.parametrize("size", ["few", pytest.param("all", marks=pytest.mark.validate)])
def test_the_strip_is_that_of_the_pages(report, tmp_path, monkeypatch, size):
    if size == "few":
        of_few_particles(monkeypatch)
    found = report("front_page.py", "--out", tmp_path)
    phi = [value for name, value in found.items() if name.startswith("phi_")]
    assert len(phi) == 5
    assert all(0.6 < value < 0.95 for value in phi)  # jammed
    assert found["omega_mode"] > 0
    names = {path.name for path in tmp_path.glob("*.png")}
    for page in ("README.md", "docs/index.md"):
        assert set(PICTURE.findall((ROOT / page).read_text(encoding="utf-8"))) == names
    for path in tmp_path.glob("*.png"):
        picture = Image.open(path)
        assert picture.size == (360, 360)
        assert path.stat().st_size < 60_000
        assert len(np.unique(np.asarray(picture.convert("L")))) > 10  # something is drawn
