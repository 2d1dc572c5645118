"""The text of LAMMPS data files: sections, atom styles, and what our pair styles state there."""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jamshape.arrays import FloatArray
from jamshape.files.lammps_columns import (
    BLOCK_COMMENT,
    BLOCKS,
    DIAMETERS,
    EXPONENT,
    EXPONENT_COMMENT,
    FORM,
    FORM_COMMENT,
    IMAGE,
    POSITION,
    QUATERNION,
    TITLE,
    Frame,
    columns_of,
    digits_of,
    round_columns,
    whole,
)
from jamshape.files.meaning import Said
from jamshape.shapes.shape import Stiffness, power_of, stiffness_of, stiffness_told
from jamshape.shapes.table import SHAPES

_ATOMS = ("id", "type", "ellipsoidflag", "density", *POSITION)
_SPHERES = ("id", "type", "diameter", "density", *POSITION)
_ELLIPSOIDS = ("id", *DIAMETERS, *QUATERNION)
_ATOM_STYLE = "ellipsoid"
# Columns behind those of ellipsoids, by other styles in an atom style hybrid.
_HYBRID = {
    "atomic": (),
    **dict.fromkeys(("molecular", "bond", "angle"), ("mol",)),
    "charge": ("q",),
    "full": ("mol", "q"),
}
_ATOMS_OF_HYBRID = ("id", "type", "x", "y", "z", "ellipsoidflag", "density")
_PAIRS = {"Pair Coeffs": 1, "PairIJ Coeffs": 2}  # types in a row


def data_frame(text: str) -> Frame:
    """Parse a data file; raise `ValueError` if it is incomplete or of another atom style."""
    if not text:
        msg = "the file is empty, expected a LAMMPS data file"
        raise ValueError(msg)
    if not text.endswith("\n"):
        msg = "the file ends within a line, expected a complete data file"
        raise ValueError(msg)
    sections = _sections(text)
    header = _header(sections[""].rows)
    if "atoms" not in header:
        msg = "the header has no line 'N atoms', expected a LAMMPS data file"
        raise ValueError(msg)
    n = int(header["atoms"][0])
    atom_rows = _numbered(_section(sections, "Atoms", n), sections.get("Atom Type Labels"))
    names = _atom_columns(sections["Atoms"].title, len(atom_rows[0].split()))
    columns = columns_of(atom_rows, names, names)
    if "diameter" in columns:
        columns |= round_columns(columns)
    else:
        _require_ellipsoids(columns)
        rows = _section(sections, "Ellipsoids", n)
        ellipsoids = _ellipsoids(rows, sections["Ellipsoids"].comments)
        if not np.array_equal(columns["id"], ellipsoids["id"]):
            msg = "Atoms and Ellipsoids hold different ids, expected one ellipsoid for each atom"
            raise ValueError(msg)
        columns |= ellipsoids
    said = replace(_said(text, sections, columns), digits=digits_of(atom_rows, names))
    others: dict[str, NDArray[Any]] = {"q": columns["q"]} if "q" in columns else {}
    others |= _form(text, columns)
    others |= {"mol": whole(columns["mol"])} if "mol" in columns else {}
    return Frame(columns, *_bounds(header), said, others=others)


class _Section(NamedTuple):
    """Rows of a data file under a title."""

    title: str
    """Comment behind it, such as the atom style."""
    rows: list[str]
    """Rows without comments and blank lines."""
    comments: list[str]
    """Comments behind the rows."""


def _sections(text: str) -> dict[str, _Section]:
    """Return rows by the title of their section, '' for the header."""
    sections = {"": _Section("", [], [])}
    here = sections[""]
    for line in text.splitlines()[1:]:
        content, _, comment = (part.strip() for part in line.partition("#"))
        if content[:1].isalpha():
            here = sections.setdefault(content, _Section(comment, [], []))
        elif content:
            here.rows.append(content)
            here.comments.append(comment)
    return sections


def _numbered(rows: list[str], labels: _Section | None) -> list[str]:
    """Replace type labels by numbers, if the file has labels."""
    if labels is None:
        return rows
    numbers = {words[1]: words[0] for words in (row.split() for row in labels.rows)}
    words = [row.split() for row in rows]
    return [" ".join([id_, numbers.get(label, label), *rest]) for id_, label, *rest in words]


def _atom_columns(title: str, count: int) -> tuple[str, ...]:
    """Name the columns of Atoms by the atom style in its title."""
    style, *others = title.split() or [_ATOM_STYLE]
    if style in {_ATOM_STYLE, "sphere"}:
        names = _ATOMS if style == _ATOM_STYLE else _SPHERES
        return names if count == len(names) else (*names, *IMAGE)
    what = "expected atoms of style ellipsoid or sphere; write the file from LAMMPS with atom_style ellipsoid"
    if style != "hybrid":
        msg = f"the section is titled 'Atoms # {title}', {what}"
        raise ValueError(msg)
    known = others[:1] == [_ATOM_STYLE] and set(others[1:]) <= set(_HYBRID)
    more = [column for name in others[1:] for column in _HYBRID[name]] if known else []
    plain = (*_ATOMS_OF_HYBRID, *more)
    if not known or count not in {len(plain), len(plain) + len(IMAGE)}:
        msg = (
            f"the section is titled 'Atoms # {title}', which does not define its {count} columns, {what}, or"
            " name the styles of the hybrid in the title, ellipsoid first, such as"
            " 'Atoms # hybrid ellipsoid molecular'"
        )
        raise ValueError(msg)
    return plain if count == len(plain) else (*plain, *IMAGE)


def _require_ellipsoids(atoms: Mapping[str, FloatArray]) -> None:
    """Refuse columns of another atom style, and atoms that are not ellipsoids."""
    if not ((atoms["ellipsoidflag"] == 1) & (atoms["density"] > 0)).all():
        msg = (
            "columns of Atoms are not those of atom_style ellipsoid, expected 1 as ellipsoidflag and a"
            " positive density in each row; name the atom style in the title, such as 'Atoms # ellipsoid'"
        )
        raise ValueError(msg)


def _ellipsoids(rows: Sequence[str], comments: Sequence[str]) -> dict[str, FloatArray]:
    """Read the section Ellipsoids, with exponents and forms if present."""
    has_blocks = len(rows[0].split()) == len(_ELLIPSOIDS) + len(BLOCKS)
    names = (*_ELLIPSOIDS, *BLOCKS) if has_blocks else _ELLIPSOIDS
    ours = {EXPONENT_COMMENT: EXPONENT, BLOCK_COMMENT: BLOCKS, FORM_COMMENT: ("form",)}
    for beginning, more in ours.items():
        if all(comment.startswith(beginning) for comment in comments):
            told = [comment.removeprefix(beginning) for comment in comments]
            rows, names = [f"{a} {b}" for a, b in zip(rows, told, strict=True)], (*names, *more)
    return columns_of(rows, names, names)


def _form(text: str, columns: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    """Return the forms (N, K) of particles, if the file has them: from comments of ours, or coefficients of types."""
    forms: dict[int, list[float]] = {}
    for line in text.splitlines() if "form" in columns else ():
        if line.startswith(FORM):
            number, _, words = line.removeprefix(FORM).partition(":")
            forms.setdefault(int(number), []).extend(map(float, words.split()))
    return _form_rows(forms, columns["form"]) if forms else {}


def _form_rows(forms: Mapping[int, Sequence[float]], of: FloatArray) -> dict[str, FloatArray]:
    """Return forms (N, K) by their numbers (N,), shorter ones with zeros behind."""
    unknown = set(of.tolist()) - forms.keys()
    if unknown:
        msg = f"a particle has form {min(unknown):g}, expected one of the {len(forms)} forms that the file lists"
        raise ValueError(msg)
    width = max(map(len, forms.values()))
    rows = {number: [*row, *[0.0] * (width - len(row))] for number, row in forms.items()}
    return {"form": np.array([rows[int(number)] for number in of])}


def _said(text: str, sections: Mapping[str, _Section], columns: dict[str, FloatArray]) -> Said:
    """Collect the metadata of a data file; exponents of types go to the columns."""
    first = text.partition("\n")[0]
    if first.startswith(TITLE) and "#" in first:
        words = dict(word.split("=", 1) for word in first.split("#")[1].split() if "=" in word)
        law: dict[str, Any] = {k: float(words[k]) for k in ("sides", "power") if k in words}
        law |= {"k_e": stiffness_told(words["k_e"])} if "k_e" in words else {}
        rows = sections["PairIJ Coeffs"].rows if "PairIJ Coeffs" in sections else []
        if not all(_is_of(law.get("k_e", 1.0), row.split()) for row in rows):
            msg = "PairIJ Coeffs differ from k_e in the first line, expected both to agree; change both"
            raise ValueError(msg)
        dimension = int(words["dimension"]) if "dimension" in words else None
        return Said(dimension, words.get("shape", ""), law, is_ours=True)
    for name, n_types in _PAIRS.items():
        shape = sections[name].title.partition("/")[0] if name in sections else ""
        if shape in SHAPES:
            return said_by_pairs(
                shape, [row.split() for row in sections[name].rows], n_types, columns
            )
    return Said()


def said_by_pairs(
    shape: str, rows: Sequence[Sequence[str]], n_types: int, columns: dict[str, FloatArray]
) -> Said:
    """Read the coefficients of our pair styles, as LAMMPS's `write_data` writes them."""
    k_e = _stiffness(rows, n_types)
    own = {int(row[0]): row for row in rows if len(set(row[:n_types])) == 1}
    if SHAPES[shape].has_exponent and not {*EXPONENT, *BLOCKS} & set(columns):
        usual = np.ones((1, 1))
        told = {kind: np.array([row[n_types + 1 :]], np.float64) for kind, row in own.items()}
        known = {kind: form if form.size else usual for kind, form in told.items()}
        width = max((form.shape[1] for form in known.values()), default=1)
        wide = [
            SHAPES[shape].widened(known.get(int(kind), usual), width)[0] for kind in columns["type"]
        ]
        columns |= dict(zip(EXPONENT if width == 1 else BLOCKS, np.array(wide).T, strict=True))
    if SHAPES[shape].has_form:
        forms = {kind: [float(x) for x in row[n_types + 1 :]] for kind, row in own.items()}
        columns |= _form_rows(forms, columns["type"])
    return Said(shape=shape, law={"k_e": k_e})


def law_of_settings(style: str) -> dict[str, Any]:
    """Read the constants of contacts among the settings of a pair style of ours, ``sides one law power 3``."""
    own, _, law = style.partition(" law ")
    sides = {"sides": 1 if own.endswith("sides one") else 2}
    return sides | ({"power": power_of(law)} if law else {})


def _is_of(k_e: Stiffness, row: Sequence[str]) -> bool:
    """Return whether a row I J k_e agrees with known stiffnesses."""
    i, j = (int(kind) - 1 for kind in row[:2])
    if not isinstance(k_e, tuple):
        return float(row[2]) == k_e
    return max(i, j) < len(k_e) and float(row[2]) == k_e[i][j]


def _stiffness(rows: Sequence[Sequence[str]], n_types: int) -> Stiffness:
    """Return k_e from the rows of Pair Coeffs, which LAMMPS mixes for unlike types, or PairIJ Coeffs."""
    found = {tuple(map(int, row[:n_types])): float(row[n_types]) for row in rows}
    types = range(1, max(map(max, found), default=0) + 1)
    pairs = [(i, j) if n_types == 2 else (i,) for i in types for j in types[i - 1 :]]
    if not found or set(pairs) != set(found):
        msg = f"pair coefficients have {len(found)} rows for {len(types)} types, expected {len(set(pairs)) or 'some'}"
        raise ValueError(msg)
    if len(set(found.values())) == 1:
        return next(iter(found.values()))
    if n_types == 1:
        said = (
            "Pair Coeffs state k_e of equal types only: that of unlike ones is the geometric mean, as LAMMPS reads it; write"
            " the file with 'write_data FILE pair ij' to keep others"
        )
        warnings.warn(said, stacklevel=2)
        own = np.array([found[(i,)] for i in types])
        table = np.sqrt(np.multiply.outer(own, own))
        np.fill_diagonal(table, own)
        return stiffness_of(table)
    return stiffness_of([[found[min(i, j), max(i, j)] for j in types] for i in types])


def _header(lines: Sequence[str]) -> dict[str, list[str]]:
    """Return numbers by the keyword that follows them on their line."""
    header = {}
    for line in lines:
        words = line.split()
        numbers = list(itertools.takewhile(lambda word: not word[0].isalpha(), words))
        header[" ".join(words[len(numbers) :])] = numbers
    return header


def _section(sections: Mapping[str, _Section], name: str, n: int) -> list[str]:
    rows = sections[name].rows if name in sections else []
    if len(rows) != n or n == 0:
        msg = f"section {name} has {len(rows)} rows for {n} atoms, expected one for each ellipsoid"
        raise ValueError(msg)
    return rows


def _bounds(header: Mapping[str, list[str]]) -> tuple[FloatArray, FloatArray]:
    bounds = [header.get(f"{x}lo {x}hi", []) for x in "xyz"]
    tilt = header.get("xy xz yz", ["0"] * 3)
    if any(len(ends) != 2 for ends in bounds) or len(tilt) != 3:
        msg = (
            "the header describes no box, expected 'xlo xhi', 'ylo yhi', 'zlo zhi', and 'xy xz yz' if"
            " it is tilted"
        )
        raise ValueError(msg)
    return np.array(bounds, dtype=np.float64), np.array(tilt, dtype=np.float64)
