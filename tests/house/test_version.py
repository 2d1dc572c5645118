"""The version, the citation and the paper of the journal say the same as pyproject.toml and each other."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]


def test_the_citation_is_of_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.findall(r"^version: (.+)$", text, re.MULTILINE) == [VERSION]


def test_the_newest_release_that_is_told_is_this_version():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## ([\d.]+), ", text, re.MULTILINE)[0] == VERSION


PAPER = (ROOT / "paper" / "paper.md").read_text(encoding="utf-8")
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")


def test_the_paper_has_the_title_and_authors_of_the_citation():
    _, head, _ = PAPER.split("---\n", 2)
    mine = CITATION.split("\nreferences:")[0]
    for key in (r"title: (.+)", r"  - name: (.+)"):
        found = re.findall(rf"^{key}$", head, re.MULTILINE)
        assert found
        assert found == re.findall(rf"^{key}$", mine, re.MULTILINE)


def test_the_paper_keeps_to_the_format_of_joss():
    head, body = PAPER.split("---\n", 2)[1:]
    headings = re.findall(r"^# (.+)$", body, re.MULTILINE)
    wanted = [
        "Summary",
        "Statement of need",
        "State of the field",
        "Software design",
        "Research impact statement",
    ]
    assert headings == [*wanted, "AI usage disclosure", "Acknowledgements", "References"]
    assert 750 <= len(body.split()) <= 1750
    assert "bibliography: paper.bib" in head


def test_every_reference_of_the_paper_is_cited_and_listed():
    cited = set(re.findall(r"@(\w+)", PAPER.split("---\n", 2)[2]))
    listed = (ROOT / "paper" / "paper.bib").read_text(encoding="utf-8")
    assert cited == set(re.findall(r"^@\w+\{(\w+),$", listed, re.MULTILINE))


def test_the_figures_of_the_paper_are_in_the_repository():
    figures = re.findall(r"\]\((\S+\.png)\)", PAPER)
    assert len(figures) == 2
    assert all((ROOT / "paper" / figure).exists() for figure in figures)
