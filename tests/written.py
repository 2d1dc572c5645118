"""Files of runs for tests."""

from pathlib import Path

from jamshape.files.content import Content
from jamshape.protocols.approach import FOR_A_PACKING

FINISHED = {"kind": FOR_A_PACKING, "finished": True}
"""Attributes of the file of a finished compression for a packing."""


def write_content(path, frames, attributes=None, rows=(), report=()):
    """Write frames, rows of (step, time, observables) and of the report, and return the content."""
    content = Content(Path(path), [frames[0]], dict(attributes or {}))
    for frame in frames[1:]:
        content.add_frame(frame)
    for step, time, observables in rows:
        content.add_row(step, time, observables)
    content.report = list(report)
    content.write()
    return content


def write_columns(path, packing, attributes, columns):
    """Write one frame, and rows of scalars at the steps 0, 1, 2, ..."""
    values = zip(*columns.values(), strict=True)
    rows = [
        (step, float(step), dict(zip(columns, map(float, row), strict=True)))
        for step, row in enumerate(values)
    ]
    return write_content(path, [packing], attributes, rows)
