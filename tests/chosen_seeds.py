"""Tests of packings that were chosen by their seed: the same seed is another packing where sine and cosine have other bits."""

import numpy as np
import pytest

from jamshape.files.origin import origin

CHOSEN_WHERE = "sin to pow d67a1671"  # glibc 2.36 on a processor with FMA

# BLAS, with which some packings of tests are minimised, sums in another order without it.
HAS_AVX512 = np._core._multiarray_umath.__cpu_features__["AVX512F"]

chosen_by_seed = pytest.mark.xfail(
    not HAS_AVX512 or CHOSEN_WHERE not in origin(),
    reason="the seed is another packing here, which may not be what the test is about",
    strict=False,
)


def chosen_among(cases, names):
    """Parameters of a test, of which those with these names are packings that were chosen by their seed."""
    return [
        pytest.param(case, marks=chosen_by_seed) if str(case) in names else case for case in cases
    ]
