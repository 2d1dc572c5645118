"""How Sphinx builds the site: ./run docs, into build/docs."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective
from sphinx.writers.html5 import HTML5Translator

import jamshape
from jamshape.commands import COMMANDS, options_of

DOCS = Path(__file__).parent
ROOT = DOCS.parent

project = "jamshape"
project_copyright = "the jamshape developers"
version = release = jamshape.__version__
language = "en"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_gallery.gen_gallery"]
myst_enable_extensions = ["deflist", "dollarmath"]
myst_heading_anchors = 4
# Examples are run when the site is built, so that every output is a real one; an error in one ends the build.
nb_execution_mode = "cache"
nb_execution_cache_path = str(ROOT / "build" / "docs" / "executed")
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

# ./run docs copies the pages to build/pages/docs, from where Sphinx reads them, and the scripts of the gallery beside it,
# where they are run. Their pages, pictures and checksums stay, so that only scripts that changed are run again.
sys.path.insert(0, str(DOCS))  # for gallery_pictures
SCRIPTS = ROOT / "build" / "pages" / "scripts"
SECTIONS = ("shapes", "packings", "shear", "modes", "programs")
sphinx_gallery_conf = {
    "examples_dirs": str(SCRIPTS),
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "subsection_order": [f"../{SCRIPTS.name}/{name}" for name in SECTIONS],
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib", "gallery_pictures.show_movies"),
    "reset_modules": ("matplotlib", "gallery_pictures.keep_margins"),
    "image_srcset": ["2x"],
    "capture_repr": (),
    "notebook_extensions": set(),  # MyST-NB would read them as pages
    "download_all_examples": False,
    "show_signature": False,
    "write_computation_times": False,
    "abort_on_example_error": True,
}

autodoc_typehints = "none"  # the docstrings have them, with shapes and units
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False

highlight_language = "none"  # of commands and decks; Python says that it is Python

# Formulas are MathML in the pages: browsers set them without scripts and without the network.
html_math_renderer = "mathml"
html_theme = "furo"
html_static_path = ["style.css"]
html_css_files = ["style.css"]
html_title = "jamshape"
html_show_sourcelink = False

# Pages that stand beside the code, where readers of the code look for them, and are shown in the site as well.
BESIDE_CODE = {
    "development/architecture": "ARCHITECTURE.md",
    "development/changelog": "CHANGELOG.md",
    "development/contributing": "CONTRIBUTING.md",
    "reference/analysis-scripts": "analysis/README.md",
}
_LINK = re.compile(r"\[([^\]]*)\]\(([^)#\s]*)(#[^)\s]*)?\)")


def read_page(app: Sphinx, name: str, source: list[str]) -> None:
    """Take pages beside the code from there, and lead links to where the site has what they name."""
    del app
    beside = BESIDE_CODE.get(name)
    path = ROOT / beside if beside else DOCS / f"{name}.md"
    if beside or path.exists():  # a notebook has no links to other pages
        text = path.read_text(encoding="utf-8") if beside else source[0]
        source[0] = _LINK.sub(lambda link: _led(link, path.parent, name), text)


def _led(link: re.Match[str], folder: Path, name: str) -> str:
    """Return a link as the site has it; the text alone of one to a file of the repository that is no page."""
    text, target, anchor = link[1], link[2], link[3] or ""
    if not target or "://" in target:
        return link[0]
    found = (folder / target).resolve()
    for page, beside in BESIDE_CODE.items():
        if found == ROOT / beside:
            found = DOCS / f"{page}.md"
    if found == ROOT / "README.md":
        found = DOCS / "index.md"
    if DOCS in found.parents and found.is_file():
        if DOCS / "gallery" in found.parents:  # a script, or the header of a section
            name_of_page = found.stem if found.suffix == ".py" else "index"
            found = found.with_name(f"{name_of_page}.rst")
        return f"[{text}]({os.path.relpath(found, (DOCS / name).parent)}{anchor})"
    return text


class CommandsHelp(SphinxDirective):
    """A section for each subcommand with its help, as the terminal shows it."""

    def run(self) -> list[nodes.Node]:
        """Return the sections."""
        os.environ["COLUMNS"] = "100"
        found: list[nodes.Node] = []
        for name in COMMANDS:
            text = options_of(name).format_help()
            section = nodes.section(ids=[name])
            section += nodes.title(name, name)
            section += nodes.literal_block(text, text, language="text")
            found.append(section)
        return found


_LETTER = re.compile(r"(\\math(?:bf|cal|bb|sf))\s+(\w)")


def mathml(node: nodes.math | nodes.math_block, display: str) -> str:
    r"""Convert a formula; ``\mathbf r`` as ``\mathbf{r}``, which becomes a bold letter and not an attribute browsers ignore."""
    return convert(_LETTER.sub(r"\1{\2}", node.astext()), display=display)


def write_formula(writer: HTML5Translator, node: nodes.math) -> None:
    """Write a formula within a line."""
    writer.body.append(mathml(node, "inline"))
    raise nodes.SkipNode


def write_equation(writer: HTML5Translator, node: nodes.math_block) -> None:
    """Write a displayed formula, in a box that style.css lets scroll."""
    writer.body.append(f'<div class="math">{mathml(node, "block")}</div>')
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, Any]:
    """Add what pages of this site need."""
    app.connect("source-read", read_page)
    app.add_directive("commands-help", CommandsHelp)
    app.add_html_math_renderer("mathml", (write_formula, None), (write_equation, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
