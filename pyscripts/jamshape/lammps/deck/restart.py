"""A compression that goes on after a kill: from a restart file that is whole, with what it will write again cut off.

LAMMPS writes restart.a and restart.b in turn. One that a kill cut short lacks its end, and then the other is taken.
A run that was killed in its last moments has neither any more, but its end, final.restart. What is read is written last: the variable `restarts` names both, in the order in which to write them.
"""

from __future__ import annotations

from pathlib import Path

from jamshape.lammps.deck.asking import Deck, Refused, quoted
from jamshape.lammps.deck.whole import cut_dump, is_whole_restart

_PAIR = ("restart.a", "restart.b")
_END = "final.restart"
_DUMPS = ("particles.dump", "contacts.dump")


def restart(deck: Deck, _: list[str]) -> None:
    """Find the restart file to go on from, if the deck has the variable `restart`, and set `restarts`.

    Raises
    ------
    Refused
        One sentence, if there is none that is whole.
    """
    named, first = deck.ask("restart"), 0
    if named is not None:
        place = Path(named.strip('"'))
        found = newest_whole(place)
        if found is None:
            msg = (
                f"{place} is no whole restart file and none lies beside it, expected one of a run "
                "that was cut off: start anew without -var restart."
            )
            raise Refused(msg)
        if found != place:
            deck.order(
                "print", f"Goes on from {found.name}, the newest restart file that is whole."
            )
            deck.order("set", "restart", quoted(str(found)))
        first = int(found.resolve() == Path("restart.a").resolve())
    deck.order("set", "restarts", f"{_PAIR[first]} {_PAIR[1 - first]}")


def newest_whole(place: Path) -> Path | None:
    """Restart file to read where one is named, or the folder of a run; None if there is none that is whole."""
    if is_whole_restart(place):
        return place
    if not place.is_dir() and place.name not in _PAIR:
        return None
    folder = place if place.is_dir() else place.parent
    pair = [path for path in (folder / name for name in _PAIR) if is_whole_restart(path)]
    end = folder / _END if is_whole_restart(folder / _END) else None
    return max(pair, key=lambda path: path.stat().st_mtime_ns, default=end)


def mend(deck: Deck, _: list[str]) -> None:
    """Cut from the dumps what a run that goes on will write again, and set `counted`, its evaluations so far."""
    counted = 0
    if deck.ask("restart") is not None:
        counted = evaluations(Path("log.lammps"), deck.step)
        for name in _DUMPS:
            cut_dump(Path(name), deck.step)
    deck.order("set", "counted", str(counted))


def evaluations(log: Path, step: int) -> int:
    """Find the evaluations up to a step, the most of all rows up to it: the process that asks has a row there, too."""
    names: list[str] = []
    found = 0
    with log.open(errors="replace") as lines:
        for line in lines:
            words = line.split()
            if words[:1] == ["Step"]:
                names = words if "v_forces" in words else []
            elif (
                names and len(words) == len(names) and words[0].isdigit() and int(words[0]) <= step
            ):
                number = words[names.index("v_forces")]
                found = max(found, int(number) if number.isdigit() else 0)
    return found
