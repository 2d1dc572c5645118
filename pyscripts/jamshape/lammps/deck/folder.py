"""The folder that a deck writes to: it is made and entered, has room or has not, and holds what is whole alone.

What a deck writes at once it writes as NAME.part, and then has it finished: that takes away the .part of files that are
whole, so that a kill leaves none by halves, and ends with a sentence where the disk was full.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from jamshape.lammps.deck.asking import Deck, Ended, Refused, quoted
from jamshape.lammps.deck.settings import require_settings
from jamshape.lammps.deck.whole import cut_dump, is_whole_data, is_whole_restart

_WRITTEN = ("initial.data", "final.restart", "final.data")


def enter(deck: Deck, _: list[str]) -> None:
    """Refuse settings that are none, and go to the folder that the variable `out` names, which is made if need be.

    Before, `data` and `restart` become full paths, in quotes for LAMMPS. Nothing stays behind where LAMMPS was started, its first log included.

    Raises
    ------
    Refused
        One sentence about a setting, a file that is not there, or a folder that cannot be made.
    """
    value = require_settings(deck)
    if "out" not in value:
        msg = "Found no variable out, expected the folder for what is written: write 'variable out index FOLDER'."
        raise Refused(msg)
    out = Path(value["out"]).absolute()
    if out.resolve() != Path.cwd():
        deck.forget_log()
    for name in ("data", "restart"):
        if name in value:
            deck.order("set", name, quoted(_full_path(name, value[name])))
    try:
        out.mkdir(parents=True, exist_ok=True)
        for name in _WRITTEN:
            (out / f"{name}.part").unlink(missing_ok=True)
        os.chdir(out)
    except OSError as error:
        msg = (
            f"Cannot make the folder {out} ({error.strerror}), expected one to write to: name another "
            "with -var out."
        )
        raise Refused(msg) from error
    deck.order("enter", str(out))


def _full_path(name: str, value: str) -> str:
    is_folder = name == "restart" and Path(value).is_dir()  # of a run: its newest
    if not is_folder and not Path(value).is_file():
        msg = f"Found no file {value}, expected the one that -var {name} names: give its path from this folder."
        raise Refused(msg)
    full = str(Path(value).absolute())
    if set('"*%') & set(full):
        msg = f"{name} is {full!r}, expected a path without quotes, * and %: move it to another folder."
        raise Refused(msg)
    return full


def initial(_: Deck, options: list[str]) -> None:
    """Write the random start `initial.data`, by the command ``jamshape initial`` with these options.

    Raises
    ------
    Refused
        One sentence, that of the command.
    """
    import subprocess  # noqa: PLC0415 - takes long to start

    Path("initial.data").unlink(missing_ok=True)
    command = [sys.executable, "-P", "-m", "jamshape", "initial", *options, "--out", "initial.data"]
    done = subprocess.run(command, text=True, capture_output=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines() or [
            f"{sys.executable} ended with {done.returncode}"
        ]
        msg = f"Found no initial state: {said[-1]}."
        raise Refused(msg)


def room(deck: Deck, words: list[str]) -> None:
    """See to it that the disk has room for so many bytes a particle, and that it did not halt a run.

    LAMMPS says so too late, and not what to do. The words are the bytes and, of a run that may have been halted,
    whether it was, and how many MB the disk was short of then.

    Raises
    ------
    Ended
        One sentence.
    """
    needed = float(words[0]) * deck.atoms
    is_halted = words[1:3] == ["halted", "1"]
    if is_halted:
        needed = 1e6 * float(words[4])
    disk = os.statvfs(".")
    free = disk.f_bavail * disk.f_frsize
    if is_halted or free < needed:
        msg = (
            f"{Path.cwd()} has room for {free / 1e6:.3g} MB, expected at least {needed / 1e6:.3g} MB "
            "for what is still to be written: make room, or name another folder with -var out; "
            "a compression goes on with -var restart."
        )
        raise Ended(msg)


def finish(_: Deck, dumps: list[str]) -> None:
    """Take away the .part of what was written, and see to it that dumps have their end; LAMMPS does not.

    Raises
    ------
    Ended
        One sentence, if the disk was full; files that lack their end are taken away, and dumps cut.
    """
    parts = [path for path in (Path(f"{name}.part") for name in _WRITTEN) if path.is_file()]
    are_whole = all(
        (is_whole_restart if ".restart" in path.name else is_whole_data)(path) for path in parts
    )
    were_cut = [cut_dump(Path(name)) for name in dumps]
    if not parts or not are_whole or any(were_cut):
        for path in parts:
            path.unlink()
        msg = (
            f"{Path.cwd()} has no room for all that was written, expected a disk that is not "
            "full: make room and start again, a compression with -var restart."
        )
        raise Ended(msg)
    for path in parts:
        path.rename(path.with_suffix(""))
