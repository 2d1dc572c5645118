import math

import numpy as np
import pytest

from common.averages import mean, standard_error
from jamshape.measures.averages import Mean


def test_mean_leaves_out_what_is_not_known():
    found = mean([1.0, 2.0, np.nan, 6.0])
    assert (found.value, found.samples) == (3.0, 3)
    assert found.error == pytest.approx(np.std([1, 2, 6], ddof=1) / np.sqrt(3))
    assert math.isnan(mean([5.0]).error)
    assert math.isnan(mean([]).value)
    assert mean([]).samples == 0


def test_text_has_the_digits_that_the_error_leaves():
    assert Mean(0.84123456, 0.0005, 3).text() == "0.8412 +- 0.0005"
    assert Mean(0.84123456, 2e-7, 3).tex == r"0.8412346 \pm 0.0000002"
    assert Mean(5.9, 0.2, 3).text() == "5.900 +- 0.200"
    assert Mean(1.0, 0.0, 2).text() == "1.000000000 +- 0.000000000"
    assert Mean(0.25).text() == "0.2500"
    assert mean([]).text() == ""


def test_standard_error_of_rows():
    rows = np.array([[1.0, 2.0], [3.0, 2.0]])
    assert standard_error(rows) == pytest.approx([1.0, 0.0])
    assert standard_error(rows[:1]) == pytest.approx([0.0, 0.0])
