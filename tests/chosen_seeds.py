"""Tests of packings that were chosen by their seed: the same seed is another packing where sine and cosine have other bits."""

import pytest

from jamshape.files.origin import origin

CHOSEN_WHERE = "sin to pow d67a1671"  # glibc 2.36 on a processor with FMA

chosen_by_seed = pytest.mark.xfail(
    CHOSEN_WHERE not in origin(),
    reason="the seed is another packing here, which may not be what the test is about",
    strict=False,
)
