"""Every block of code on a page is run, in the order of the page, by the tests; those that cannot be say why not.

A page is read as its reader does: in one folder, from top to bottom, by one bash and one Python. Commands have options
behind them that make them quick. Of what is not run, and of whole command lines in the text, every word is looked at:
options and their values, scripts, decks with their settings, files of the repository and pictures.
"""

import contextlib
import importlib.util
import io
import re
from pathlib import Path
from typing import NamedTuple

import pytest
from code_blocks import ROOT, Block, blocks_of, command_lines, pages, text_of
from programs import check, run
from sessions import BLOCK, make_clone, run_in_bash
from thinned import quick

import jamshape as js
from jamshape.commands import COMMANDS, sweep


class Told(NamedTuple):
    """Blocks, and what is told of them."""

    page: str
    words: str
    """In the block or in the title above it; all blocks of the page if empty."""
    what: str


NOT_RUN = [
    Told("README.md", "./run demo", "installs packages; tests/house/test_run.py runs a small demo"),
    Told("CONTRIBUTING.md", "", "installs packages, runs these tests, sets up machines as root"),
    Told("ARCHITECTURE.md", "contact/  <-", "shows which folder uses which"),
    Told("docs/how-to/another-shape.md", "./run test", "runs these tests"),
    Told("docs/how-to/cluster.md", "git clone", "downloads packages"),
    Told("docs/how-to/cluster.md", "snakemake -s", "needs Snakemake, and Slurm; tests/decks/test_sweep_with_snakemake.py"),
    Told("docs/how-to/cluster.md", "sbatch", "needs Slurm; tests/cluster/slurm_on_one_node.py"),
    Told("docs/how-to/decks.md", "-var jamshape", "needs a clone at a reader's path; tests/decks/test_decks.py"),
    Told("docs/how-to/install.md", "./run setup", "installs packages; every other ./run begins with it"),
    Told("docs/how-to/install.md", "tests/debian", "makes a Debian as root, or a LAMMPS"),
    Told("docs/how-to/install.md", "pip", "downloads and compiles; ./run wheel does it"),
    Told("docs/development/releases.md", "", "downloads and compiles; ./run wheel does it"),
    Told("docs/how-to/reproduce.md", "pip install", "downloads packages"),
    Told("docs/how-to/reproduce.md", "--known", "needs packings of a paper; tests/scripts/test_sample_tables.py"),
    Told("docs/how-to/reproduce.md", "snakemake -s", "needs Slurm; tests/scripts/test_reproduce_with_snakemake.py"),
    Told("docs/reference/*.md", "Syntax\n", "has names in the place of values"),
    Told("docs/results/*.md", "", "takes minutes to hours: the calculations behind the numbers of the page"),
]  # fmt: skip

RUN_BY = [
    Told("ARCHITECTURE.md", "checks <-", "tests/house/test_pages.py"),
    Told("docs/how-to/other-tools.md", "", "tests/jamshape/exchange/test_recipes.py"),
    Told("docs/how-to/python-on-ranks.md", "", "tests/decks/test_python_on_ranks.py"),
    Told("docs/reference/*.md", "Examples\n", "tests/styles/test_style_pages.py"),
]

FILES = [
    Told("README.md", "create_random", "rods.in"),
    Told("docs/how-to/decks.md", "create_random spherocylinder", "rods.in"),
    Told("docs/how-to/your-own-states.md", "create_random spherocylinder", "own.in"),
    Told("docs/how-to/stress.md", "create_random spherocylinder", "ramp.in"),
]
"""Blocks that the page tells its reader to keep in a file."""

OUTPUT = "text"
"""The language of what a program prints, which nobody types."""

SMALL = "--n 16 --phi-start 0.55 --u0 1e-6"
# Few steps: each waits for the other rank, which takes long where all cores are busy.
DECK = "-var n 16 -var kappa 1e-2 -var dt 0.1 -var phi_end 0.42 -var rows 4 -var frames 2"
QUICK = [
    Told("*", "--search bisection", "--u0 1e-5 --accuracy 0.2 --tolerance 1e-2"),
    Told("*/protocols.md", "--start", "--u0 1e-6"),
    Told("*", "--protocol marschall-2018", "--n 16 --alpha 1 --phi-start 0.55 --kappa 1e-4 --u0 1e-6"),
    Told("*", "--protocol yuan-2019-1", "--n 16 --delta-phi 0.02 --tolerance 1e-1 --phi-start 0.3"),
    Told("*", "--protocol yuan-2019-2", "--n 16 --delta-phi 0.02 --tolerance 1e-1 --phi-start 0.3 --n-sweeps 20"),
    Told("*/protocols.md", "jamshape slow", "--n 16 --alpha 1 --phi-start 0.8 --kappa 1e-5 --phi-end 0.95"),
    Told("*/energies-and-modes.md", "jamshape pack", "--n 16"),
    Told("*/movies.md", "jamshape draw", "--dpi 50 --every 4"),
    Told("*/stress.md", "jamshape pack", "--threads 1"),
    Told("*", "jamshape sweep", f"--samples 1 {SMALL}"),
    Told("*", "jamshape pack --alpha 4", f"--alpha 1 {SMALL}"),
    Told("*", "jamshape pack", "--n 16 --u0 1e-6"),
    Told("*", "jamshape compress", "--alpha 1 --n 16 --kappa 1e-3 --rows 20 --frames 4"),
    Told("*", "jamshape slow", "--alpha 1 --n 16 --phi-start 0.7 --phi-end 0.72 --kappa 1e-6"),
    Told("*", "jamshape shear", "--alpha 1 --n 16 --gdot 1e-2 --strain 0.5 --rows 20 --frames 4"),
    Told("*", "jamshape cycle", "--alpha 1 --n 16 --period 20 --cycles 2 --rows 8"),
    Told("*/stress.md", "--stress-step", "--stress-step 1e-4 --strain 0.1"),
    Told("*", "jamshape aqs", "--step 1e-2 --strain 0.1"),
    Told("*", "analysis/shear/elastic_limit.py", "--alpha 0 --n 12 --samples 1 --accuracy 0.5 --steps 4"),
    Told("*", "jamshape draw", "--dpi 50"),
    Told("*", "jamshape reproduce", "--dry-run"),
    Told("*", "-in inputs/compress_spherocylinder.in", DECK),
]  # fmt: skip
"""Changes that make a command quick: the first on such a page that has all these words."""

SHORTER = {
    "README.md": {"n": 16},
    "docs/how-to/energies-and-modes.md": {"n": 16},
    "docs/how-to/shear.md": {"n": 16, "strain": 1, "cycles": 2},
    "docs/how-to/movies.md": {"n": 16, "step": 4},  # of 1e-2: half as many frames
}
"""Words of calls in Python, where their numbers are 1 or more, and what they are in a test."""

ALL_BLOCKS = [block for page in pages() for block in blocks_of(page)]


def told(table, block):
    return [one for one in table if block.fits(one.page, one.words)]


def is_directive(block):
    return block.language.startswith("{")


def is_script(block):
    return block.text.startswith("#!/bin/bash\n")


# --- the rule -------------------------------------------------------------------------------------


def test_every_block_is_run_or_says_why_not():
    def is_code(block):
        return block.language in {"python", "shell", OUTPUT} or is_script(block)

    lost = [
        block
        for block in ALL_BLOCKS
        if not is_directive(block)
        and not is_code(block)
        and not any(told(table, block) for table in (NOT_RUN, RUN_BY, FILES))
    ]
    assert lost == []


@pytest.mark.parametrize("table", [NOT_RUN, RUN_BY, FILES], ids=["not run", "run by", "files"])
def test_no_line_of_a_table_is_of_a_block_that_went(table):
    assert [one for one in table if not any(b.fits(one.page, one.words) for b in ALL_BLOCKS)] == []


def test_what_another_test_runs_it_finds_on_the_page():
    for one in RUN_BY:
        folder, _, name = one.page.rpartition("/")
        text = (ROOT / one.what).read_text(encoding="utf-8")
        assert name in text or Path(folder).name in text


def test_what_is_printed_is_nothing_to_type():
    typed = re.compile(r"^(?:\S*/)?(?:jamshape|lmp|mpirun|pip|python3?) ", re.MULTILINE)
    assert [b for b in ALL_BLOCKS if b.language == OUTPUT and typed.search(b.text)] == []


def test_blocks_are_found_in_fences_and_where_they_are_indented():
    page = "# A\n\nSay\n\n    one\n\n    two\n\n## B\n\n```python\nx\n```\n\n- a\n\n    b\n\n```\n    c\n```\n"
    assert list(blocks_of("a.md", page)) == [
        Block("a.md", "A", "shell", "one\n\ntwo\n"),
        Block("a.md", "B", "python", "x\n"),
        Block("a.md", "B", "", "    c\n"),
    ]


def test_a_page_that_is_included_is_read():
    blocks = list(blocks_of("docs/a.md", "```{include} reference/python.md\n```\n"))
    assert blocks == list(blocks_of("docs/reference/python.md"))


@pytest.mark.parametrize(
    ("program", "words"),
    [
        ("jamshape", "pack --alpha 4"),
        ("jamshape", "pack --nonsense --out a.h5"),
        ("python", "analysis/draw.py a.h5 --nonsense"),
        ("python", "analysis/nothing.py a.h5"),
        ("python", "analysis/draw.py a.h5 --out docs/pictures/nothing.png"),
        ("lmp", "-in inputs/compress_spherocylinder.in -var nonsense 1"),
        ("snakemake", "-s pyscripts/sweep.smk --config nonsense=1"),
        ("snakemake", "-s pyscripts/sweep.smk --config sweep=--nonsense"),
        ("run", "sing"),
    ],
)
def test_wrong_words_are_found(program, words):
    with pytest.raises(AssertionError):
        check(ROOT, program, words.split())


@pytest.mark.parametrize(
    ("program", "words"),
    [("pip", "install nothing"), ("python3", "tests/debian/suite_in_a_root.py"), ("run", "setup")],
)
def test_what_changes_the_machine_is_never_run(program, words):
    with pytest.raises(AssertionError, match="name the block in NOT_RUN"):
        run(ROOT, program, words.split())


def test_bash_has_no_programs_but_these(tmp_path):
    make_clone(tmp_path / "clone")
    with pytest.raises(AssertionError, match="command not found"):
        run_in_bash("mkdir -p a\nrm -r a", tmp_path / "clone", lambda *_: 0)
    assert (tmp_path / "clone" / "a").is_dir()


# --- pages are run --------------------------------------------------------------------------------


class Reader:
    """Someone who does what a page says, in a folder that looks like a clone."""

    def __init__(self, page, folder):
        self.page, self.folder = page, folder
        self.blocks = [b for b in blocks_of(page) if not is_directive(b) and b.language != OUTPUT]
        self.block, self.names, self.said = None, {}, io.StringIO()

    def read(self):
        make_clone(self.folder)
        run_in_bash("\n".join(map(self.script_of, range(len(self.blocks)))), self.folder, self.call)

    def script_of(self, k):
        """Lines of bash for a block; what is not of the shell is done where the block begins."""
        block = self.blocks[k]
        text = self.here(block) if block.language == "shell" or is_script(block) else ""
        if told(RUN_BY, block) or told(FILES, block):
            text = ""
        if is_script(block):
            jobs = re.findall(r"^#SBATCH --array=(\d+)-(\d+)", text, re.MULTILINE) or [("",)]
            text = f"for SLURM_ARRAY_TASK_ID in {' '.join(jobs[0]) or 0}; do\n(\n{text})\ndone"
        return f"{BLOCK} {k}\n{text}"

    def here(self, block):
        return block.text.replace("/home/you/jamshape", str(self.folder))

    def call(self, place, program, words):
        """Do what is asked of a program; return its exit code."""
        if program == BLOCK:
            self.begin(place, self.blocks[int(words[0])])
            return 0
        if told(NOT_RUN, self.block):
            check(place, program, words)
            return 0
        code = run(place, program, [*words, *self.quick(program, words)])
        # The paper's minimiser may end before forces balance as well as ours do.
        assert not code or (code == 1 and "--minimiser" in words), (program, words, code)
        return 0

    def begin(self, place, block):
        self.block = block
        for file in told(FILES, block):
            # tests/decks/test_decks.py runs all of its steps.
            (place / file.what).write_text(re.sub(r"(?m)^run .*", "run 40", self.here(block)))
        if block.language == "python" and not told(RUN_BY, block):
            code = block.text
            for name, value in SHORTER.get(self.page, {}).items():
                code = re.sub(rf"\b{name}=[1-9][\d.]*", f"{name}={value}", code)
            with contextlib.chdir(place), contextlib.redirect_stdout(self.said):
                exec(compile(code, self.page, "exec"), self.names)  # noqa: S102 - our own page

    def quick(self, program, words):
        line = [program, *(word.replace(f"{self.folder}/", "") for word in words)]
        fitting = (o for o in QUICK if block_of(self.page).fits(o.page, "") and set(o.words.split()) <= set(line))  # fmt: skip
        return next((one.what.split() for one in fitting), [])


def block_of(page):
    return Block(page, "", "", "")


WITH_CODE = dict.fromkeys(block.page for block in ALL_BLOCKS if not is_directive(block))
LONG = {
    f"docs/how-to/{name}.md"
    for name in (
        *("shear", "twelve-tasks", "command", "many-packings", "stress"),
        *("protocols", "energies-and-modes"),
    )
}
"""Pages that take more than five seconds; in the default suite only their words are checked."""


class Proofreader(Reader):
    """Someone who looks at the words of each program on a page, and runs none."""

    def call(self, place, program, words):
        if program == BLOCK:
            block = self.blocks[int(words[0])]
            if block.language == "python":
                compile(block.text, self.page, "exec")
        else:
            check(place, program, words)
        return 0


@pytest.mark.lammps
@pytest.mark.parametrize("page", quick(WITH_CODE, WITH_CODE.keys() - LONG))
def test_the_code_of_a_page_runs(page, tmp_path, monkeypatch):
    folder = tmp_path / "clone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    monkeypatch.setenv("MPLBACKEND", "agg")
    reader = Reader(page, folder)
    reader.read()
    if page in AFTER:
        AFTER[page](folder, reader.said.getvalue())


@pytest.mark.parametrize("page", sorted(LONG))
def test_the_code_of_a_long_page_has_words_that_programs_know(page, tmp_path, monkeypatch):
    folder = tmp_path / "clone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    Proofreader(page, folder).read()


# The CHANGELOG tells what was, and not what is.
@pytest.mark.parametrize("page", [page for page in pages() if page != "CHANGELOG.md"])
def test_command_lines_in_the_text_of_a_page_are_right(page):
    for program, words in command_lines(page):
        check(ROOT, program, words)


# --- what is there when a page was read -----------------------------------------------------------


def look_at_the_readmes_packing(folder, said):
    phi_J, phi, pressure, z = map(float, re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", said)[:4])
    assert 0.7 < phi_J < 0.9
    assert 0.7 < phi < 0.9
    assert 0 < pressure < 1e-5
    assert 5 < z < 6.5
    packing = js.load(folder / "packing.h5")
    assert packing.results["outcome"] in {"converged", "sliding"}
    assert all((folder / name).stat().st_size > 10_000 for name in ("pressure.png", "packing.png"))
    if importlib.util.find_spec("gsd"):
        again = js.load(folder / "rods.gsd")
        assert (again.position == packing.position).all()
        assert (again.orientation == packing.orientation).all()


def look_at_the_jobs_of_an_array(folder, _):
    """The first and the last make samples of their own, over which the page takes averages."""
    clone = folder / "jamshape"  # which the page has fetched
    names = {path.name for path in (clone / "sweep").glob("*.h5")}
    assert names == {"alpha4_seed1.h5", "alpha4_seed901.h5"}
    assert (clone / "phi_j.png").exists()


def look_at_modes_and_energies(folder, _):
    assert len(list((folder / "ladder").glob("*.h5"))) == 2
    assert (folder / "spectrum.png").exists()


AFTER = {
    "README.md": look_at_the_readmes_packing,
    "docs/how-to/cluster.md": look_at_the_jobs_of_an_array,
    "docs/how-to/energies-and-modes.md": look_at_modes_and_energies,
}


# --- what pages are complete in -------------------------------------------------------------------


def test_readme_is_a_screen_and_a_half():
    assert len(text_of("README.md").splitlines()) <= 120


def test_the_deck_of_readme_is_the_one_that_is_tested_from_everywhere():
    kept = [(b.text, one.what) for b in ALL_BLOCKS for one in told(FILES, b)]
    [of_readme, of_page] = [text for text, name in kept if name == "rods.in"]
    assert of_readme == of_page


def test_twelve_tasks_take_at_most_fifteen_lines_each():
    blocks = [
        b for b in ALL_BLOCKS if b.page.endswith("twelve-tasks.md") and b.language == "python"
    ]
    lines = [len([line for line in b.text.splitlines() if line.strip()]) for b in blocks]
    assert len(lines) == 1 + 12  # the first makes what is read
    assert max(lines) <= 15


def test_every_command_is_on_its_page():
    page = text_of("docs/how-to/command.md")
    names = re.findall(r"^    jamshape (\w+)", page, re.MULTILINE)
    assert set(names) == set(COMMANDS)
    assert re.findall(r"^\*\*(\w+)\*\* ", page, re.MULTILINE) == list(dict.fromkeys(names))


def test_samples_of_sweeps_on_the_cluster_have_files_of_their_own():
    texts = re.findall(r'sweep="([^"]*)"', text_of("docs/how-to/cluster.md"))
    assert texts
    for text in texts:
        options = sweep.options_of().parse_args([*text.split(), "--out", "out"])
        particles = sweep.particles(options)
        files = {sweep.file_of(p, s, options) for p in particles for s in sweep.seeds(options)}
        assert len(files) == len(particles) * options.samples
