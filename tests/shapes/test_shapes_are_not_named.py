"""A new shape runs all tests beside this one with no line changed: none of them names a shape."""

import re
from pathlib import Path

import pytest
from every_shape import ALL, MIXTURES, PURE, TYPICAL

from jamshape.shapes.table import SHAPES

HERE = Path(__file__).parent
NAMES = re.compile("|".join(SHAPES), re.IGNORECASE)


@pytest.mark.parametrize("path", sorted(HERE.rglob("*.py")), ids=lambda path: path.stem)
def test_no_shape_is_named(path):
    assert NAMES.findall(path.read_text(encoding="utf-8")) == []


def test_every_shape_has_scenes_in_the_plane_and_in_space():
    for cases in (ALL, MIXTURES, PURE, TYPICAL):
        assert {case[:2] for case in cases} == {
            (name, D) for name in SHAPES for D in SHAPES[name].dimensions
        }
