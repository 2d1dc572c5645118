"""Do what one command ``jamshape WORD ...`` of a deck asks; LAMMPS starts this and carries out what it orders."""

from __future__ import annotations

import re
import sys

from jamshape.lammps.deck.asking import Deck, Ended, Refused
from jamshape.lammps.deck.folder import enter, finish, initial, room
from jamshape.lammps.deck.restart import mend, restart
from jamshape.lammps.deck.settings import NUMBER

# What each does, and what may stand behind it: a pattern of these arguments with a space after each, and in words.
WORDS = {
    "enter": (enter, "", ""),
    "restart": (restart, "", ""),
    "initial": (initial, r"(--[a-z-]+ \S+ )*", "--OPTION VALUE ..., as the command 'jamshape initial' has them"),
    "mend": (mend, "", ""),
    "room": (room, f"{NUMBER} (halted [01] short {NUMBER} )?", "BYTES [halted 0|1 short MB]"),
    "finish": (finish, ".*", "[DUMP ...]"),
}  # fmt: skip


def carry_out(deck: Deck, word: str, arguments: list[str]) -> None:
    """Do what a word asks.

    Raises
    ------
    Ended
        One sentence, if there is no such word, arguments are not its own, or the deck cannot go on.
    """
    found = " ".join(["jamshape", word, *arguments])
    if word not in WORDS:
        msg = f"Found '{found}', expected one of {', '.join(WORDS)}, styles."
        raise Ended(msg)
    do, pattern, usage = WORDS[word]
    if not re.fullmatch(pattern, "".join(f"{argument} " for argument in arguments)):
        msg = f"Found '{found}', expected '{f'jamshape {word} {usage}'.strip()}'."
        raise Ended(msg)
    try:
        do(deck, arguments)
    except OSError as error:
        msg = (
            f"Cannot carry out '{found}' ({error}), expected a folder that can be read and written to: "
            "name another with -var out."
        )
        raise Ended(msg) from error


def main() -> None:
    """Answer LAMMPS, which tells its process, the number of atoms and the step."""
    process, atoms, step, word, *arguments = sys.argv[1:]
    deck = Deck(int(process), int(atoms), int(step))
    try:
        carry_out(deck, word, arguments)
    except Ended as error:
        if isinstance(error, Refused):
            deck.forget_log()
        deck.order("end", plain(str(error)))
    else:
        deck.order("done")


def plain(sentence: str) -> str:
    """Take out of a sentence what terminals and those who search logs might stumble over."""
    signs = (sign if sign.isprintable() and sign not in "$&" else "?" for sign in sentence)
    return "".join(signs).encode("ascii", "replace").decode().replace('"', "'")


if __name__ == "__main__":
    main()
