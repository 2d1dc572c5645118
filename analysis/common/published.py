"""Published measurements, for comparison in figures and tables.

T. Marschall and S. Teitel, Phys. Rev. E 97, 012905 (2018): bidisperse spherocylinders in the plane, N = 1024,
by aspect ratio alpha. A `Mean` without an error is exact to its last digit.
"""

from __future__ import annotations

from jamshape.measures.averages import Mean

N = 1024

PHI_J = {0.0: Mean(0.8412, 0.0005), 1.0: Mean(0.8875), 4.0: Mean(0.866)}
"""Jamming densities, Secs. III A and B, in the limit of slow compression, kappa up to 1e-9."""

DISTANCE = {
    0.01: {1e-15: 7.4e-8, 1e-14: 2.4e-7, 1e-12: 2.4e-6},
    4.0: {1e-15: 9.1e-8, 1e-11: 9.3e-6, 1e-9: 4.3e-4},
}
"""phi - phi_J by energy density u, captions of Figs. 14 and 18. That of alpha = 4 at 1e-9 does not fit the others."""

Z = {0.0: Mean(4.0), 0.01: Mean(4.43, 0.03), 1.0: Mean(5.91, 0.01), 4.0: Mean(5.64, 0.01)}
"""Contacts per particle, side-to-side ones counted twice, Sec. III C and Fig. 8."""

RATTLERS = {0.01: 34.0, 1.0: 0.0, 4.0: 1.2}
"""Mean number of side-to-side contacts among the 1024 particles, Sec. III C."""

BANDS = {
    4.0: {"low": 0.0638, "middle": 0.00033, "high": 0.936},
    1.0: {"low": 0.0039, "middle": 0.0105, "high": 0.986},
    0.01: {"low": 0.0, "middle": (6 - 4.43) / 6, "high": 4.43 / 6},
}
"""Fractions of all modes in each band at u = 1e-15, Sec. III D."""
