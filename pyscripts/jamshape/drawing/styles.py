"""Colours and marks of all figures."""

from __future__ import annotations

# Okabe & Ito: colours distinguishable with any colour vision.
BLACK, ORANGE, SKY, GREEN, BLUE, RED = (
    "#000000",
    "#E69F00",
    "#56B4E9",
    "#009E73",
    "#0072B2",
    "#D55E00",
)
YELLOW = "#F0E442"

# Colours in pictures: rattlers, points of contact, and kinds by ascending size.
RATTLER, CONTACT = "#cfcfcf", "#d7191c"
KINDS = ("#86c98a", "#6ea6dc", "#e9b04d", "#c76f9b", "#9a7fc0", "#e07b53", "#4fa3a5", "#b5b04a")
