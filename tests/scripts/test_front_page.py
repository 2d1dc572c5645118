"""The strip of pictures of the front page: its pictures, their size, and the packings that they show."""

import re
from pathlib import Path

import numpy as np
from PIL import Image

ROOT = Path(__file__).parents[2]
PICTURE = re.compile(r"pictures/(front_\w+\.png)")


def test_the_strip_is_that_of_the_pages(report, tmp_path):
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
