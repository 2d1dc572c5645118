"""Features beside the fix that moves particles and box."""

from math import exp

from features.feature import Feature

_FIX = "fix f all overdamped/affine drag 1.0 compress 1e-2"

MOVING = (
    Feature(
        "`run ... every`",
        f"{_FIX}\ntimestep 0.1\nrun 50 every 10 'print here'",
        "lx",
        20 * exp(-0.05),
    ),
)
