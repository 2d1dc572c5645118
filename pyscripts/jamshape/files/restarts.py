"""LAMMPS restart files, two in turn: one of them is complete at any time."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from jamshape.files.signature import RESTART, SIGNATURES

# LAMMPS writes it at the end, too.
_MAGIC = SIGNATURES[RESTART]


def is_whole(path: Path) -> bool:
    """Whether a restart file exists and is complete."""
    try:
        with path.open("rb") as file:
            head = file.read(len(_MAGIC))
            size = file.seek(0, os.SEEK_END)
            file.seek(max(len(_MAGIC), size - len(_MAGIC)))
            return head == file.read() == _MAGIC
    except FileNotFoundError:
        return False


@dataclass(frozen=True)
class RestartFiles:
    """The restart files of a run, ``PREFIX.a`` and ``PREFIX.b``.

    Parameters
    ----------
    prefix : Path
    """

    prefix: Path

    def newest(self) -> Path | None:
        """Find the newest complete file."""
        found = [path for path in self._paths() if is_whole(path)]
        return max(found, key=lambda path: path.stat().st_mtime_ns, default=None)

    def next(self) -> Path:
        """Return the path to write next: not the newest."""
        newest = self.newest()
        return next(path for path in self._paths() if path != newest)

    def forget(self) -> None:
        """Remove them."""
        for path in self._paths():
            if path.exists():  # unlink fails on a read-only disk even for missing files
                path.unlink()

    def _paths(self) -> list[Path]:
        return [self.prefix.with_name(f"{self.prefix.name}.{end}") for end in "ab"]
