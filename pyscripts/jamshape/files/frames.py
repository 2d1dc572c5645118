"""Elements of a frame in a file, and the layout of its box."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray
from jamshape.packing import Lengths, Packing

if TYPE_CHECKING:
    from jamshape.files.disk import PathLike

# Elements under /particles/all, some by the fields of a packing.
RESTS = {"position_rest": "position_rest", "orientation_rest": "orientation_rest"}
EDGES, EDGES_REST = "box/edges", "box/edges_rest"
COLUMNS = "columns"

_MATRICES = 3  # dimensions of a dataset (T, D, D)


class Form(NamedTuple):
    """Optional content of the frames of a file."""

    rests: bool = False
    """Low parts of coordinates."""
    tilted: bool = False
    """Boxes as matrices, with or without tilt."""

    @classmethod
    def of(cls, packing: Packing) -> Form:
        """Return the form of a file with this frame alone."""
        return cls(packing.has_rests, packing.box.is_tilted or bool(packing.tilt_rest.any()))

    def joined(self, other: Form) -> Form:
        """Return the form of a file with frames of both."""
        return Form(self.rests or other.rests, self.tilted or other.tilted)


class MissingFrameError(ValueError):
    """A file has fewer frames than were asked for."""


def row_of(frame: int, n_frames: int, path: PathLike) -> int:
    """Count a frame from 0, a negative one from the end; MissingFrameError if there is none."""
    if not -n_frames <= frame < n_frames:
        msg = f"{path}: has {n_frames} frames, expected frame {frame} to be one of them"
        raise MissingFrameError(msg)
    return frame % n_frames


def frame_values(packing: Packing, form: Form) -> dict[str, NDArray[Any]]:
    """Return the elements of a frame by name."""

    def stored(edges: FloatArray, tilt: FloatArray) -> FloatArray:
        # H5MD has edge vectors as rows.
        return np.ascontiguousarray(Lengths(edges, tilt).matrix.T) if form.tilted else edges

    values = {
        "position": packing.position,
        "orientation": packing.orientation,
        "image": packing.image,
        EDGES: stored(packing.box.edges, packing.box.tilt),
        "box/lo": packing.box.lo,
    }
    if form.rests:
        values |= {element: getattr(packing, name) for name, element in RESTS.items()}
        values[EDGES_REST] = stored(packing.edges_rest, packing.tilt_rest)
    return values


def column_values(frames: Sequence[Packing]) -> dict[str, NDArray[Any]]:
    """Return the elements (T, N) or (T, N, k) of the columns that all frames have, texts as bytes."""

    def stored(name: str) -> NDArray[Any]:
        rows = [frame.columns[name] for frame in frames]
        return np.stack([np.char.encode(x, "utf-8") if x.dtype.kind == "U" else x for x in rows])

    def is_in_all(name: str) -> bool:
        rows = [frame.columns.get(name) for frame in frames]
        like = {None if row is None else (row.shape, row.dtype.kind) for row in rows}
        return len(like) == 1

    names = filter(is_in_all, frames[0].columns)
    return {f"{COLUMNS}/{name}": stored(name) for name in names}


def column_of(stored: NDArray[Any]) -> NDArray[Any]:
    """Read a column, texts from bytes."""
    return np.char.decode(stored, "utf-8") if stored.dtype.kind == "S" else stored


def lengths_of(edges: FloatArray) -> Lengths:
    """Read a box in the layout of H5MD: edges (D,), or (D, D) edge vectors as rows."""
    return Lengths.of(edges.T) if edges.ndim > 1 else Lengths(edges, np.empty(0))


def as_rest(rest: NDArray[Any], whole: NDArray[Any]) -> NDArray[Any]:
    """Return low parts; 0 where they are too large, after another program has changed the doubles."""
    if rest.shape != whole.shape or {rest.dtype.kind, whole.dtype.kind} != {"f"}:
        return rest  # refused by Packing
    with np.errstate(over="ignore"):
        is_more = np.abs(rest) > np.spacing(np.abs(whole))
    return np.where(is_more & np.isfinite(rest), 0.0, rest)
