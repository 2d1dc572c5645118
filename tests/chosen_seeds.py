"""Tests of packings that were chosen by their seed: the same seed is another packing where sine and cosine have other bits."""

import numpy as np
import pytest

from jamshape.files.origin import origin

CHOSEN_WHERE = "sin to pow d67a1671"  # glibc 2.36 on a processor with FMA

chosen_by_seed = pytest.mark.xfail(
    CHOSEN_WHERE not in origin(),
    reason="the seed is another packing here, which may not be what the test is about",
    strict=False,
)

# BLAS, with which some packings of tests are minimised, sums in another order without it.
chosen_with_avx512 = pytest.mark.xfail(
    not np._core._multiarray_umath.__cpu_features__["AVX512F"],
    reason="the packing is another one without AVX-512, which may not be what the test is about",
    strict=False,
)
