"""Export packings to other programs.

    jamshape export run.h5 --out run.gsd
    jamshape export packing.h5 --out packing.ovito
    jamshape export run.h5 --frame 3 --out start.data

FILE is a packing or a run, a LAMMPS dump or data file, or a GSD file. The format is given by --to or by the suffix
of --out. All frames are written if the format holds several, unless --frame selects one; else the last. The last
line of standard output is one JSON object. `jamshape draw` makes pictures.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from jamshape.checks import require_free, require_other_file
from jamshape.command import parser_of, report
from jamshape.contacts import Contacts
from jamshape.exchange.gsd import write_gsd
from jamshape.exchange.mdanalysis import write_mdanalysis
from jamshape.exchange.ovito import to_ovito
from jamshape.exchange.tools import tool
from jamshape.files.disk import replacing
from jamshape.files.h5md import write_packing, write_run
from jamshape.files.lammps_text import write_data, write_dump
from jamshape.files.meaning import NOTHING, Wanted
from jamshape.front.files import load
from jamshape.front.frames import frames
from jamshape.packing import Packing
from jamshape.shapes.command_line import add_meaning_options

_PICTURES = {".png", ".pdf", ".svg", ".jpg"}


class _Format(NamedTuple):
    """An export format."""

    end: str
    """Suffix."""
    holds_many: bool
    write: Callable[[Path, Sequence[Packing]], object]
    meaning: str


def _write_session(path: Path, packings: Sequence[Packing]) -> None:
    """Write a session for OVITO, with exact bodies: rods are spherocylinders, not meshes."""
    (packing,) = packings
    ovito, pipeline = tool("ovito", "ovito"), tool("ovito.pipeline", "ovito")
    data = to_ovito(packing, Contacts.of(packing).rattlers)
    pipeline.Pipeline(source=pipeline.StaticSource(data=data)).add_to_scene()
    with replacing(path) as temporary:
        ovito.scene.save(str(temporary))


def _write_h5(path: Path, packings: Sequence[Packing]) -> None:
    first = packings[0]
    if len(packings) > 1:
        write_run(path, packings, first.to_store)
    else:
        write_packing(path, first, first.to_store)


def _write_data(path: Path, packings: Sequence[Packing]) -> None:
    (packing,) = packings
    write_data(path, packing)


FORMATS = {
    "gsd": _Format(".gsd", True, write_gsd, "for HOOMD-blue, freud and OVITO"),
    "ovito": _Format(".ovito", False, _write_session, "a session of OVITO, with exact bodies"),
    "mdanalysis": _Format(
        ".h5md", True, write_mdanalysis, "H5MD as MDAnalysis reads it, in 2D too"
    ),
    "data": _Format(".data", False, _write_data, "a data file of LAMMPS"),
    "dump": _Format(".dump", True, write_dump, "a dump of LAMMPS"),
    "h5": _Format(".h5", True, _write_h5, "H5MD of jamshape"),
}


def options_of() -> ArgumentParser:
    """Make the parser."""
    rows = [f"  {name:11} {one.end:7} {one.meaning}" for name, one in FORMATS.items()]
    parser = parser_of(__doc__)
    parser.epilog = "\n".join(["formats, with suffixes of --out:", *rows])
    parser.add_argument("file", type=Path, metavar="FILE", help="input file")
    parser.add_argument("--to", choices=FORMATS, help="format (by the suffix of --out)")
    parser.add_argument("--out", type=Path, required=True, help="file to write")
    parser.add_argument(
        "--frame", type=int, help="single frame, negative counts from the end (all)"
    )
    parser.add_argument("--again", action="store_true", help="replace an existing H5MD file")
    add_meaning_options(parser)
    return parser


def main(options: Namespace) -> None:
    """Read, write, report."""
    require_other_file(options.out, [options.file])
    name = options.to or _format_of(options.out)
    # Files for other programs are quickly made again; a packing may be the work of hours.
    require_free(options.out, again=options.again or name != "h5")
    chosen = FORMATS[name]
    frame = -1 if options.frame is None and not chosen.holds_many else options.frame
    packings = frames_of(options.file, frame, Wanted(options.dimension, options.shape))
    options.out.parent.mkdir(parents=True, exist_ok=True)
    chosen.write(options.out, packings)
    last = packings[-1]
    told = {"shape": last.shape_style, "dimension": last.dimension, "n": last.n, "phi": last.phi}
    report({"out": options.out, "to": name, "frames": len(packings), **told})


def frames_of(path: Path, frame: int | None, wanted: Wanted = NOTHING) -> Sequence[Packing]:
    """Read one frame of a file, or all.

    Raises
    ------
    FileFormatError, OSError
        As in `load`.
    ValueError
        If the frame does not exist, or the file holds modes.
    """
    if frame is None:
        return frames(path, **wanted._asdict())
    found = load(path, frame, **wanted._asdict())
    if isinstance(found, Packing):
        return [found]
    msg = f"{path} holds modes, expected a packing or a run"
    raise ValueError(msg)


def _format_of(out: Path) -> str:
    """Return a format by the suffix of a file."""
    for name, one in FORMATS.items():
        if out.suffix == one.end:
            return name
    known = ", ".join(one.end for one in FORMATS.values())
    hint = "use jamshape draw for pictures" if out.suffix in _PICTURES else "or give --to"
    msg = f"--out is {out}, expected a suffix out of {known}; {hint}"
    raise ValueError(msg)
