"""Commands on pages have options that exist: those of `jamshape`, of pyscripts/ and of analysis/, by what --help says."""

import contextlib
import functools
import io
import re
import runpy
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
# The CHANGELOG tells what was, and not what is.
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("docs/**/*.md"), *ROOT.glob("analysis/**/*.md")]  # fmt: skip
PASSED_ON = {"sweep": "pack"}  # what the one does not know it hands on to the other

COMMAND = re.compile(
    r"(?:\bjamshape (?P<name>[a-z]+)|(?P<script>(?:pyscripts|analysis)/[\w/]+\.py)) (?P<words>[^;|&`]*)"
)
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z0-9-]*")


def commands(text):
    """Names or scripts of commands in blocks and in lines of code, each with the options it is given."""
    joined = re.sub(r"\\\n\s*", " ", text)
    blocks = re.findall(r"^(?:    |\t).*$", joined, re.MULTILINE)
    blocks += re.findall(r"^```\w*\n(.*?)^```", joined, re.MULTILINE | re.DOTALL)
    spans = [span.replace("\n", " ") for span in re.findall(r"(?<!`)`([^`]+)`(?!`)", joined)]
    lines = [line for code in blocks for line in code.splitlines()] + spans
    for line in lines:
        for found in COMMAND.finditer(line.split(" #")[0]):
            yield found["script"] or found["name"], set(OPTION.findall(found["words"]))


@functools.cache
def options(name):
    """Options that --help of a script or of a command lists; None if there is no such command."""
    if name.endswith(".py"):
        script, arguments = ROOT / name, ["--help"]
    elif not (ROOT / "pyscripts" / "jamshape" / "commands" / f"{name}.py").is_file():
        return None
    else:
        script, arguments = ROOT / "pyscripts" / "jamshape" / "__main__.py", [name, "--help"]
    said = io.StringIO()
    before = sys.argv, sys.path[:]
    sys.argv, sys.path[0:0] = [str(script), *arguments], [str(script.parent)]
    try:
        with contextlib.redirect_stdout(said), pytest.raises(SystemExit):
            runpy.run_path(str(script), run_name="__main__")
    finally:
        sys.argv, sys.path[:] = before
    found = set(OPTION.findall(said.getvalue()))
    handed_on = PASSED_ON.get(Path(name).stem)
    return found | (options(handed_on) if handed_on else set())


def test_options_of_commands_and_of_scripts_are_known():
    assert {"--alpha", "--u0"} <= options("pack") <= options("sweep")
    assert {"--states", "--out"} <= options("analysis/errors/minimiser_error.py")
    assert "--nonsense" not in options("pack")
    assert options("as") is None


def test_commands_are_found_in_blocks_and_in_text():
    text = "Say `jamshape pack\n--alpha 4` or\n\n    python analysis/draw.py a.h5 \\\n        --color C4\n"
    assert list(commands(text)) == [("analysis/draw.py", {"--color"}), ("pack", {"--alpha"})]


@pytest.mark.parametrize("page", [str(page.relative_to(ROOT)) for page in sorted(PAGES)])
def test_options_of_commands_on_a_page_are_there(page):
    text = (ROOT / page).read_text(encoding="utf-8")
    known = [(name, given, options(name)) for name, given in commands(text)]
    unknown = {
        (name, option)
        for name, given, there in known
        if there is not None  # such as "import jamshape as js"
        for option in given - there
    }
    assert unknown == set()
