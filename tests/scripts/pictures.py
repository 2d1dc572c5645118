"""A look at pictures: whether anything is drawn, and of what colour."""

import numpy as np


def image(path):
    """(height, width, 3) values from 0 to 1, after a look at whether anything is drawn."""
    from matplotlib.image import imread  # noqa: PLC0415 - other helpers need none

    pixels = imread(path)[..., :3]
    assert min(pixels.shape[:2]) > 300
    assert max(pixels.shape[:2]) < 3200
    assert pixels.std() > 0.02
    return pixels


def is_color(pixels, rgb, tolerance=0.02):
    """(height, width) where pixels have a colour."""
    return (np.abs(pixels - rgb) < tolerance).all(axis=2)
