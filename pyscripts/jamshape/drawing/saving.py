"""Saving of figures; a kill or a full disk leaves files complete or unchanged."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jamshape.files.disk import PathLike, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: PathLike, **how: Any) -> None:
    """Save a figure; an existing file is replaced only when writing is complete.

    Parameters
    ----------
    figure : Figure
    path : path-like
        The suffix selects the format; ``.png`` is added if there is none.
    **how
        Arguments of ``Figure.savefig``.

    Raises
    ------
    ValueError
        If matplotlib does not support the format.
    OSError
        If the file cannot be written; the message is one sentence.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from jamshape.drawing.saving import save_figure
    >>> save_figure(Figure(), "empty.png")
    """
    place = require_picture(path)
    with replacing(place) as temporary:
        figure.savefig(temporary, format=place.suffix[1:], **how)


def require_picture(path: PathLike) -> Path:
    """Return the path of a picture as by `with_end`, or refuse one whose format matplotlib does not write.

    Raises
    ------
    ValueError
    """
    from matplotlib.backend_bases import FigureCanvasBase  # noqa: PLC0415 - slow

    place = with_end(path)
    if place.suffix[1:].lower() not in FigureCanvasBase.get_supported_filetypes():
        msg = (
            f"{place} ends in {place.suffix!r}, expected the name of a picture; choose one that ends in .png, .pdf"
            " or .svg"
        )
        raise ValueError(msg)
    return place


def with_end(path: PathLike) -> Path:
    """Return the path of a picture, with a suffix for its format."""
    place = Path(path)
    return place if place.suffix else place.with_name(f"{place.name}.png")
