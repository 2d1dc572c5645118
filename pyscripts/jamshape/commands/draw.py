"""Draw packings of any shape, in the plane and in space.

    jamshape draw FILE [MORE ...] [--frame -1] [--color kind] --out packing.png
    jamshape draw RUN.h5 --out movie.gif

FILE is H5MD, a LAMMPS dump or a data file. In the plane black lines show the spines and red dots the
contacts; in space each particle whose centre is in the box is drawn whole, in parallel projection. Colours show the
kinds of particles, with rattlers in grey (unless all are); the order of the neighbours in contact, green to red as it
grows and grey without contacts: nematic (S2), tetratic (S4, in the plane), cubatic (C4, in space); the orientation;
or the packing (one). As in Fig. 7 of Marschall & Teitel, PRE 97, 012905, and Figs. 2, 4 b, c and 8 b of Yuan,
VanderWerf, Shattuck & O'Hern, Soft Matter (2019). The last line of standard output is one JSON object with the
counts. A name such as movie.gif or movie.mp4, which needs ffmpeg, makes a movie of all frames of one file, or of
one --mode of a file that `jamshape modes --vectors` has written.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

import numpy as np

from jamshape.checks import ArgumentError, Range, require_in, require_other_file, require_stated
from jamshape.command import parser_of, report, typed
from jamshape.drawing.colors import CHOICES, NAMED, color_of
from jamshape.drawing.movie import MOVIES
from jamshape.drawing.packing import Look
from jamshape.drawing.pictures import draw_pictures, read_picture, save_pictures
from jamshape.drawing.saving import require_picture
from jamshape.files.meaning import Wanted
from jamshape.files.signature import HDF5, format_of
from jamshape.front.files import load
from jamshape.front.frames import frames
from jamshape.front.modes import Modes
from jamshape.front.movies import animate
from jamshape.packing import Packing
from jamshape.shapes.command_line import add_meaning_options
from jamshape.vibration.table import holds_modes

_ANGLE = Range(-360.0, 360.0, "degrees")

_HEIGHT, _TURN = 22, -58  # default view
_PIXELS = 200  # in an inch


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__, "packing.png")
    parser.add_argument(
        "files", type=Path, nargs="+", metavar="FILE", help="H5MD, dumps, data files"
    )
    parser.add_argument("--frame", type=int, help="frame; negative counts from the end (-1)")
    parser.add_argument("--every", type=int, help="show every n-th frame in a movie (1)")
    parser.add_argument("--fps", type=float, help="frames per second of a movie (10)")
    parser.add_argument("--mode", type=int, help="row of the mode that swings, in a file of modes")
    swing = "largest displacement in a mode, over the smallest radius (0.5)"
    parser.add_argument("--amplitude", type=float, help=swing)
    parser.add_argument(
        "--color",
        choices=(*CHOICES, *NAMED),
        default="kind",
        help="quantity shown by colour (%(default)s)",
    )
    sides = "points of a side-to-side contact; auto: as in the file, or else 2 (auto)"
    parser.add_argument("--sides", choices=("auto", "1", "2"), help=sides)
    up, around = (
        f"elevation of the view in space, degrees ({_HEIGHT})",
        f"azimuth of the view ({_TURN})",
    )
    parser.add_argument("--height", type=float, help=up)
    parser.add_argument("--turn", type=float, help=around)
    finer = (
        "refinement of meshes in space, 1 to 4; each makes four triangles of one (3, or 2 for many)"
    )
    parser.add_argument("--level", type=int, choices=range(1, 5), help=finer)
    parser.add_argument("--dpi", type=int, help=f"dots per inch ({_PIXELS}, of a movie 100)")
    add_meaning_options(parser)
    return parser


def _look(options: Namespace, *, in_space: bool) -> Look:
    """Read the look of packings, and refuse options without effect in the plane."""
    asked = typed(options, "height", "turn", "level")
    if asked and not in_space:
        name, value = next(iter(asked.items()))
        said = f"{{{name}}} has no effect in the plane, expected a packing in space; leave it out"
        raise ArgumentError(said, {name: value})
    asked = {"height": _HEIGHT, "turn": _TURN, "level": 0} | asked
    return Look(color_of(options.color), asked["height"], asked["turn"], asked["level"])


def _movie(options: Namespace) -> None:
    """Make a movie of a file, and report."""
    _require_none(options, "frame", "sides", "height", "turn", "level")
    if len(options.files) > 1:
        msg = f"{len(options.files)} files were given for a movie, expected one"
        raise ValueError(msg)
    [path] = options.files
    meaning = {"dimension": options.dimension, "shape": options.shape}
    found = load(path, **meaning)
    shown = frames(path, **meaning) if isinstance(found, Packing) else found
    how = typed(options, "fps", "every", "dpi", "amplitude")
    animate(shown, options.mode, options.out, color=color_of(options.color), **how)
    if isinstance(shown, Modes):
        report({"out": options.out, "mode": options.mode, "omega": shown.omega[options.mode]})
        return
    report({"out": options.out, "frames": len(range(0, len(shown), options.every or 1))})


def _require_none(options: Namespace, *names: str) -> None:
    """Refuse options without effect."""
    kind = "movie" if options.out.suffix.lower() in MOVIES else "picture"
    for name, value in typed(options, *names).items():
        said = f"{{{name}}} has no effect on a {kind}; leave it out, or choose another suffix of {{out}}"
        raise ArgumentError(said, {name: value, "out": options.out})


def main(options: Namespace) -> None:
    """Read, find the contacts, draw, report."""
    require_other_file(options.out, options.files)
    if options.out.suffix.lower() in MOVIES:
        _movie(options)
        return
    options.out = require_picture(options.out)
    _require_none(options, "every", "fps", "mode", "amplitude")
    for path in options.files:
        if format_of(path) == HDF5 and holds_modes(path):
            msg = f"{path} holds modes, expected particles; draw a mode with --mode and a movie, such as --out mode.gif"
            raise ValueError(msg)
    dpi = _PIXELS if options.dpi is None else options.dpi
    require_stated(dpi=dpi)
    for name, value in typed(options, "height", "turn").items():
        require_in(f"--{name}", value, _ANGLE)
    sides = int(options.sides) if options.sides in {"1", "2"} else None
    how = -1 if options.frame is None else options.frame, sides, color_of(options.color)
    wanted = Wanted(options.dimension, options.shape)
    pictures = [read_picture(path, *how, wanted) for path in options.files]
    look = _look(options, in_space=any(row.report["dimension"] == 3 for row in pictures))
    figure, colored = draw_pictures(pictures, look)
    save_pictures(figure, pictures, options.out, dpi)
    rows = [one.report for one in pictures]
    for row, colors in zip(rows, colored, strict=True):
        if len(colors.values):
            row["mean_local"] = (
                np.nanmean(colors.values) if np.isfinite(colors.values).any() else None
            )
    # Numbers of a single packing go to the top level.
    report({"out": options.out, **(rows[0] if len(rows) == 1 else {}), "packings": rows})
