"""Checks of finished figures: their text, and colours of lines and points without a name."""

import re
from pathlib import Path

import numpy as np
from matplotlib.colors import to_rgb
from matplotlib.container import ErrorbarContainer
from matplotlib.lines import Line2D
from matplotlib.text import Text

from jamshape.commands import reproduce

ANALYSIS = Path(__file__).parents[2] / "analysis"
PAPERS = tuple(name.replace("-", "_") for name in reproduce.PAPERS)
NO_PACKINGS = ("fig02_shapes",)  # of single particles

# What tells under which conditions packings were made; u on an axis has values of its own.
CONDITIONS = (r"\kappa", "u_0", "u=U/L", "compressed to $p$", r"\dot\gamma")


def require_told(script, figure):
    """A figure of packings tells N, the parameters, energy or rate, and what its colours are."""
    said = words(figure)
    assert re.search(r"N=\d", said), f"{script} does not tell N"
    assert any(name in said for name in CONDITIONS), f"{script} tells neither u0 nor kappa"
    assert re.search(r"\w+s in [23]D", said), f"{script} does not tell the shape"
    assert re.search(r"(alpha|w_1) ?=|percent| \\%|A}=p\^2", said), (
        f"{script} does not tell the parameters"
    )
    assert not unnamed(figure), f"{script} has colours without a name"


def words(figure):
    """All that is written in a figure, as one text."""
    return "\n".join(filter(None, (text.get_text() for text in figure.findobj(Text))))


def keys(figure):
    """Colours that legends and colour bars explain."""
    legends = [*figure.legends, *(a.get_legend() for a in figure.axes if a.get_legend())]
    lines = [line for legend in legends for line in legend.findobj(Line2D)]
    patches = [patch for legend in legends for patch in legend.get_patches()]
    return {to_rgb(line.get_color()) for line in lines} | {p.get_facecolor()[:3] for p in patches}


def unnamed(figure):
    """Colours of curves and points that neither a legend nor a colour bar explains; greys are guides."""
    drawn = set()
    for axes in figure.axes:
        bars = [c for c in axes.containers if isinstance(c, ErrorbarContainer)]
        lines = [*axes.get_lines(), *(bar.lines[0] for bar in bars if bar.lines[0])]
        drawn |= {to_rgb(line.get_color()) for line in lines if len(line.get_xdata()) > 1}
    known = np.array([*keys(figure)]).reshape(-1, 3)
    return [
        color
        for color in drawn
        if np.ptp(color) > 0.01 and not (np.abs(known - color) < 0.01).all(axis=1).any()
    ]
