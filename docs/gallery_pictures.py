"""Settings of Sphinx-Gallery that are functions: movies on pages, and figures with room for their legends."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import matplotlib as mpl
from sphinx_gallery.scrapers import figure_rst


def keep_margins(settings: dict[str, Any], script: str | None) -> None:
    """Save figures with all that is drawn beside their axes, after a reset of matplotlib."""
    del settings, script
    mpl.rcParams["savefig.bbox"] = "tight"


def show_movies(block: Any, variables: dict[str, Any], settings: dict[str, Any]) -> str:
    """Move new movies beside the figures of the page; return the reStructuredText that shows them."""
    del block
    movies = sorted(Path(variables["src_file"]).parent.glob("*.gif"))
    shown = [
        Path(place).with_suffix(".gif")
        for _, place in zip(movies, variables["image_path_iterator"], strict=False)
    ]
    for movie, place in zip(movies, shown, strict=True):
        shutil.move(movie, place)
    return figure_rst([str(place) for place in shown], settings["src_dir"])
