"""Words of docstrings, comments, messages and pages: a first word that is a noun or an imperative, no private phrases."""

import ast
import io
import re
import tokenize

import pytest
from test_house import LIBRARY, PLUGIN, ROOT, SHARED, docstrings, python_files, tree_of

# A docstring says what is returned or done; these begin half a sentence, or stand for a standard verb.
NO_FIRST_WORD = re.compile(
    r"\W*(?:Of|What|By|That|Those|Where|Whose|Which|Who|For|As|How|Why|When|Else|Tell|Say|Lead)\b"
)

NO_PHRASES = re.compile(
    r"\bso (?:many|often)\b"
    r"|\b(?:is|are|was|were|be) (?:told|led)\b|\band led to\b|\btold (?:by|of|apart)\b|\btells? (?:apart|what|how|all|it from)\b"
    r"|\bleads? (?:it|them|the (?:state|packing|box)) to\b"
    r"|\b(?:go|goes|going|gone) on\b|\bturns? round\b|\b(?:is|are|be) put down\b|\btaken? up again\b"
    r"|\bwhat (?:slides|is none|is left|remains|holds of|stages)\b|(?<=[.] )What (?:it|they|is|has|came|holds)\b(?=[^?|]*[.])"
    r"|\bthe asked\b|\basked of\b|\bnobody (?:says|said|knows|expects)\b|\bwhen left out\b|\b(?:small|their|the) rests?\b(?= of (?:doubles|positions))"
    r"|\b(?:it|they|which|that) (?:is|are) none\b(?! of)|\bvalues that are none\b|\bas far as it is\b"
    r"|\bcorners? of the energy\b|\bat rest on a `?corner\b|\boutcome `corner`(?! for)"
)

CPP_COMMENT = re.compile(r"(?:^[ \t]*//[^\n]*\n)+|//[^\n]*|/\*.*?\*/", re.DOTALL | re.MULTILINE)
CPP_TEXT = re.compile(r'"((?:[^"\\\n]|\\.)*)"')


def python_docs(path):
    tree = tree_of(path)
    described = set(docstrings(tree))
    return [n.value for n in ast.walk(tree) if id(n) in described]


def python_words(path):
    """Docstrings, comments and other texts, those joined from several lines as one."""
    source = path.read_text(encoding="utf-8")
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    comments = [token.string for token in tokens if token.type == tokenize.COMMENT]
    nodes = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.Constant)]
    return comments + [node.value for node in nodes if isinstance(node.value, str)]


def cpp_docs(path):
    found = CPP_COMMENT.findall(path.read_text(encoding="utf-8"))
    return [text for text in map(str.strip, found) if text.startswith(("///", "/**"))]


def cpp_words(path):
    source = path.read_text(encoding="utf-8")
    return CPP_COMMENT.findall(source) + CPP_TEXT.findall(CPP_COMMENT.sub("", source))


SOURCES = {
    "python": (python_files(*SHARED), python_docs, python_words),
    "cpp": ([*PLUGIN.rglob("*.[ch]pp"), *PLUGIN.rglob("*.h")], cpp_docs, cpp_words),
}


def one_line(text):
    return " ".join(re.sub(r"^\s*(///?|\*|#)", "", text, flags=re.MULTILINE).split())


@pytest.mark.parametrize("language", SOURCES)
def test_a_doc_begins_with_a_noun_or_an_imperative(language):
    paths, docs_of, _ = SOURCES[language]
    docs = [(path.relative_to(ROOT), one_line(doc)) for path in paths for doc in docs_of(path)]
    assert len(docs) > 100
    assert [(str(p), doc[:80]) for p, doc in docs if NO_FIRST_WORD.match(doc)] == []


# Tables that programs write between these marks have the words of their scripts.
WRITTEN = re.compile(r"<!-- table -->.*?<!-- end of table -->", re.DOTALL)


def pages():
    """Pages and notebooks of the site and those beside the code; CHANGELOG.md quotes earlier words."""
    beside = [page for page in ROOT.glob("*.md") if page.name != "CHANGELOG.md"]
    folders = [ROOT / name for name in ("analysis", "docs", "inputs", "lammps_plugin")]
    return sorted(beside) + sorted(
        p for f in folders for s in ("*.md", "*.ipynb") for p in f.rglob(s)
    )


def spelled_wrong(texts):
    """Return place, phrase and surroundings of each private phrase in texts (place, text)."""
    found = [(place, match) for place, text in texts for match in NO_PHRASES.finditer(text)]
    return [(str(p), m[0], m.string[max(0, m.start() - 40) : m.end() + 40]) for p, m in found]


@pytest.mark.parametrize("language", SOURCES)
def test_no_phrase_is_private_dialect(language):
    paths, _, words_of = SOURCES[language]
    texts = [(path.relative_to(ROOT), one_line(text)) for path in paths for text in words_of(path)]
    assert spelled_wrong(texts) == []


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.relative_to(ROOT).as_posix())
def test_no_phrase_of_a_page_is_private_dialect(page):
    text = WRITTEN.sub("", page.read_text(encoding="utf-8"))
    assert spelled_wrong([(page.name, one_line(text))]) == []


def test_phrases_are_found():
    said = [
        "is led to u0",
        "the outcome `corner`",
        "may be told apart",
        "rods go on",
        "if they are none",
    ]
    assert all(map(NO_PHRASES.search, said))
    idiomatic = [
        "The flow leads to order.",
        "outcome `corner` for `kink`",
        "It is none of these.",
        "at rest",
    ]
    assert not any(map(NO_PHRASES.search, idiomatic))


def fields_and_properties(path):
    """Yield names of fields and properties of public classes, and the first lines of their docs."""
    tree = tree_of(path)
    for owner in (n for n in ast.walk(tree) if isinstance(n, ast.ClassDef) and n.name[0] != "_"):
        for before, node in zip([None, *owner.body], owner.body, strict=False):
            if isinstance(node, ast.FunctionDef) and any(
                "property" in ast.unparse(d) for d in node.decorator_list
            ):
                yield (
                    f"{owner.name}.{node.name}",
                    (ast.get_docstring(node) or "").partition("\n")[0],
                )
            is_text = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            if is_text and isinstance(before, ast.AnnAssign):
                yield (
                    f"{owner.name}.{before.target.id}",
                    node.value.value.strip().partition("\n")[0],
                )


def test_docs_of_fields_have_no_colon_that_sphinx_takes_for_the_end_of_a_type():
    docs = {
        name: text for path in python_files(LIBRARY) for name, text in fields_and_properties(path)
    }
    assert len(docs) > 300
    assert [
        n for n, text in docs.items() if re.search(r":(?!\S)", re.sub(r"`+.*?`+", "", text))
    ] == []
