"""Colours and marks of the papers' figures."""

from __future__ import annotations

from typing import Any

from jamshape.drawing.styles import BLACK, BLUE, GREEN, ORANGE, RED, SKY, YELLOW

COLORS = (BLUE, RED, GREEN, ORANGE, SKY, BLACK)
MARKERS = "oDs^v*"

# Style of published values, behind ours.
PAPER_STYLE: dict[str, Any] = {"fmt": "*", "color": BLACK, "mfc": YELLOW, "ms": 11, "zorder": 1.5}
PAPER_STYLE |= {"label": "paper, $N=1024$"}
PAPER_LINE: dict[str, Any] = {"color": "0.5", "lw": 1, "ls": "--", "zorder": 0}

# Colours of single bodies.
BODIES = (
    *("#4fa3a5", "#e07b53", "#7b8fc7", "#c76f9b", "#8ab54a"),
    *("#d9a832", "#5c9ad1", "#9a7fc0", "#d0685f"),
)


def color(k: int) -> str:
    """Return the colour of curve number k, from 0."""
    return COLORS[k % len(COLORS)]


def marked(k: int, line: str = "") -> dict[str, Any]:
    """Return the style of curve number k, from 0: its colour and open mark, with a thin line or none."""
    style: dict[str, Any] = {"fmt": f"{MARKERS[k % len(MARKERS)]}{line}", "color": color(k)}
    return style | {"mfc": "none", "ms": 4, "lw": 0.8, "elinewidth": 0.8, "capsize": 1.5}
