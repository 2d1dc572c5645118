"""Average over samples, with its standard error."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

# Smallest and largest number of digits after the decimal point.
_DIGITS = (3, 9)


class Mean(NamedTuple):
    """An average over samples with its standard error."""

    value: float
    error: float = math.nan
    """NaN for one sample."""
    samples: int = 0
    """0 if unknown."""
    reached: Mean | None = None
    """Average over samples that reached their goal, if some did not."""

    def as_json(self) -> dict[str, Any]:
        """Return the fields for JSON; `reached` only where there are two averages."""
        found = self._asdict()
        return found if self.reached else {k: v for k, v in found.items() if k != "reached"}

    @property
    def tex(self) -> str:
        """Format in TeX, without dollars."""
        return self.text(r"\pm")

    def text(self, plus_minus: str = "+-") -> str:
        """Format to the digits that the error supports; empty for NaN."""
        if not math.isfinite(self.value):
            return ""
        if not math.isfinite(self.error):
            return f"{self.value:.4f}"
        digits = math.ceil(-math.log10(self.error)) if self.error > 0 else _DIGITS[1]
        digits = min(max(digits, _DIGITS[0]), _DIGITS[1])
        return f"{self.value:.{digits}f} {plus_minus} {self.error:.{digits}f}"
