"""Code on pages: the blocks of each in their order, and the command lines in its text."""

from __future__ import annotations

import ast
import re
import shlex
from fnmatch import fnmatch
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]

HEADING = re.compile(r"#+ (.*)")
LIST_ITEM = re.compile(r"[-*] |\d+\. |: ")
FENCE = re.compile(r"(\s*)(`{3,}|~{3,})\s*(\S*)\s*(\S*)")
INDENT = "    "


class Block(NamedTuple):
    """A piece of code that stands by itself."""

    page: str
    """Its path from the root."""
    section: str
    language: str
    """"shell" of what is indented by four spaces; of a fence what stands behind it, or nothing."""
    text: str

    def fits(self, page, words):
        """Whether it is on such a page, with these words in its text or in the title above it."""
        return fnmatch(self.page, page) and words in f"{self.section}\n{self.text}"


def beside_code():
    """List the pages of the site that stand beside the code, as docs/conf.py has them."""
    for node in ast.parse((ROOT / "docs" / "conf.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == "BESIDE_CODE":
            return ast.literal_eval(node.value).values()
    msg = "docs/conf.py names no pages BESIDE_CODE"
    raise AssertionError(msg)


def pages():
    """List README and all pages of the site by their paths from the root."""
    site = (path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").rglob("*.md"))
    return sorted({"README.md", *beside_code(), *site})


def text_of(page):
    return (ROOT / page).read_text(encoding="utf-8")


def blocks_of(page, text=None):
    """Find the blocks of a page, those of pages that it includes among them."""
    lines = (text_of(page) if text is None else text).splitlines()
    section, in_list, at = "", False, 0
    while at < len(lines):
        line, begun = lines[at], at
        after_blank = at == 0 or not lines[at - 1].strip()
        at += 1
        if fence := FENCE.match(line):
            indent, mark, language, name = fence.groups()
            while at < len(lines) and not lines[at].strip().startswith(mark):
                at += 1
            inner = "".join(f"{x.removeprefix(indent)}\n" for x in lines[begun + 1 : at])
            at += 1
            if language == "{include}":
                yield from blocks_of(((ROOT / page).parent / name).relative_to(ROOT).as_posix())
            else:
                yield Block(page, section, language, inner)
        elif line.startswith(INDENT) and after_blank and not in_list:
            while at < len(lines) and (lines[at].startswith(INDENT) or not lines[at].strip()):
                at += 1
            inner = "\n".join(x.removeprefix(INDENT) for x in lines[begun:at])
            yield Block(page, section, "shell", inner.strip("\n") + "\n")
        elif line.strip() and not line.startswith(" "):
            in_list = bool(LIST_ITEM.match(line))
            if heading := HEADING.match(line):
                section = heading[1]


def command_lines(page):
    """Find the whole command lines in the text of a page: those that begin with a path, or name an input."""
    prose = re.sub(r"^```.*?^```", "", text_of(page), flags=re.MULTILINE | re.DOTALL)
    for span in re.findall(r"(?<!`)`([^`]+)`(?!`)", prose):
        words = shlex.split(span.replace("\n", " ")) if "..." not in span else []
        while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
            del words[0]
        begins = words[0].startswith((".venv/bin/", "./run")) if words else False
        if len(words) > 1 and (begins or words[0] in {"python", "python3", "lmp", "mpirun"}):
            yield Path(words[0]).name, words[1:]
