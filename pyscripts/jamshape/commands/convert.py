"""Convert files of jamshape 0.1.0 to the present format.

    jamshape convert packing.h5 run.h5
    jamshape convert old/*.h5 --out new

FILE is a packing, a run, modes or a GSD file. It is replaced when its conversion is complete; with --out, copies are
written to a folder. Numbers stay the same to the bit, except that translations among modes become exact zeros. Files
of the present format stay as they are. A run that was interrupted keeps its rows and frames, but cannot be resumed. The
last line of standard output is one JSON object.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections import Counter
from pathlib import Path
from typing import Any

from jamshape.checks import require_folder, require_path
from jamshape.command import parser_of, report
from jamshape.commands.earlier import Converted, convert
from jamshape.files.disk import store
from jamshape.files.lock import Lock
from jamshape.files.vocabulary import FORMAT_VERSION


def options_of() -> ArgumentParser:
    """Make the parser."""
    parser = parser_of(__doc__)
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="files to convert")
    parser.add_argument("--out", type=Path, metavar="FOLDER", help="folder for copies (in place)")
    return parser


def main(options: Namespace) -> None:
    """Convert, print, report."""
    outs = _outs(options.files, options.out)
    rows = [_row(path, out) for path, out in zip(options.files, outs, strict=True)]
    report({"files": rows, "converted": sum(row["converted"] for row in rows)})


def _outs(files: list[Path], folder: Path | None) -> list[Path]:
    """Name the files to write; refuse to write two to one place, or over another."""
    if folder is None:
        return files
    require_folder(folder)
    outs = [folder / path.name for path in files]
    out, n = Counter(outs).most_common(1)[0]
    if n > 1:
        msg = f"{n} files are called {out.name}, expected one to be written to {out}; convert them one by one"
        raise ValueError(msg)
    for out in outs:
        require_path(out)
        if out.exists():
            msg = f"{out} exists, expected --out to be a folder without it; choose another folder"
            raise ValueError(msg)
    folder.mkdir(parents=True, exist_ok=True)
    return outs


def _row(path: Path, out: Path) -> dict[str, Any]:
    """Convert a file, and say so."""
    with Lock(out):
        found = convert(path, out)
        if found is None and out != path:
            store(out, path.read_bytes())
    print(f"{out}: {_told(path, found)}")
    row = {"file": path, "out": out, "converted": found is not None}
    return row | (found._asdict() if found else {"version": FORMAT_VERSION})


def _told(path: Path, found: Converted | None) -> str:
    if found is None:
        return f"has format {FORMAT_VERSION} already"
    said = f"{found.kind}, converted from format {found.version} to {FORMAT_VERSION}"
    if found.finished:
        return said
    journal = path.with_name(f"{path.name}.journal")
    left = f", without the rows in {journal}" if journal.exists() else ""
    return (
        f"{said}{left}; it is not finished and cannot be resumed, repeat its command with --again"
    )
