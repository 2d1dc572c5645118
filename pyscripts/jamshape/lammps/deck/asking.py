"""The deck that asks for something, and the process of LAMMPS that runs it."""

from __future__ import annotations

import os
import sys
from pathlib import Path

TYPE_CHECKING = False  # the module typing takes long to start
if TYPE_CHECKING:
    from collections.abc import Iterator


class Ended(Exception):  # noqa: N818 - it is not always an error
    """A deck cannot go on; the text is the sentence that it ends with."""


class Refused(Ended):
    """It ends before anything has run, and leaves nothing where it was started."""


class Deck:
    """A deck, on standard input and output of this process; LAMMPS itself is at the other end.

    An order is one line: a sign that no complaint of Python begins with, a verb, and texts. These go as x and their
    bytes in hex, so that no sign in them means anything on the way.
    """

    def __init__(self, process: int, atoms: int, step: int) -> None:
        self.process = process  # its ID, on rank 0
        self.atoms, self.step = atoms, step

    def order(self, verb: str, *texts: str) -> None:
        """Have all ranks do something: print TEXT, set NAME TEXT (a variable), enter FOLDER, end SENTENCE, done."""
        words = [f"@{verb}", *(f"x{os.fsencode(text).hex()}" for text in texts)]
        sys.stdout.write(" ".join(words) + "\n")
        sys.stdout.flush()

    def ask(self, name: str) -> str | None:
        """Value of a variable of the deck; None where there is none of this name."""
        self.order("ask", name)
        answer = sys.stdin.readline().strip()
        return os.fsdecode(bytes.fromhex(answer[1:])) if answer.startswith("x") else None

    def arguments(self) -> list[str]:
        """Words of the command line of LAMMPS."""
        words = Path("/proc", str(self.process), "cmdline").read_bytes()
        return os.fsdecode(words).split("\0")

    def open_files(self) -> Iterator[Path]:
        """Give the files that LAMMPS reads, those opened last first; the deck is one of them."""
        place = Path("/proc", str(self.process))
        for link in sorted((place / "fd").iterdir(), key=lambda link: -int(link.name)):
            path = link.resolve()
            if path.is_file() and not _is_written(place / "fdinfo" / link.name):
                yield path

    def forget_log(self) -> None:
        """Take away LAMMPS's first log, which it began where it was started."""
        log = Path("log.lammps").resolve()
        links = Path("/proc", str(self.process), "fd").iterdir()
        if any(link.resolve() == log for link in links):
            log.unlink(missing_ok=True)


def _is_written(description: Path) -> bool:
    flags = next(line for line in description.read_text().splitlines() if line.startswith("flags:"))
    return int(flags.split()[1], 8) & os.O_ACCMODE != os.O_RDONLY


def quoted(path: str) -> str:
    """Write a path as the value of a variable that stands where LAMMPS reads a file, with spaces or without.

    The quotes have to be in the variable: around it they would keep LAMMPS from putting it in.
    """
    return f'"{path}"'
