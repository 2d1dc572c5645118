"""Pictures in files, which a kill or a full disk leaves whole or as they were."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jamshape.files.disk import PathLike, replacing

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def save_figure(figure: Figure, path: PathLike, **how: Any) -> None:
    """Draw a figure into a file, which replaces what was there only when all is drawn.

    Parameters
    ----------
    figure : Figure
    path : path-like
        Its end tells the format; ``.png`` is put there if it has none.
    **how
        To ``Figure.savefig``.

    Raises
    ------
    ValueError
        If matplotlib knows no such format.
    OSError
        One sentence, if the file cannot be written.

    Examples
    --------
    >>> from matplotlib.figure import Figure
    >>> from jamshape.drawing.saving import save_figure
    >>> save_figure(Figure(), "empty.png")
    """
    place = with_end(path)
    with replacing(place) as temporary:
        figure.savefig(temporary, format=place.suffix[1:], **how)


def with_end(path: PathLike) -> Path:
    """Return the path of a picture, with an end that tells its format."""
    place = Path(path)
    return place if place.suffix else place.with_name(f"{place.name}.png")
