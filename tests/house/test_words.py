"""Words of docstrings, comments and messages: a first word that is a noun or an imperative, and no private phrases."""

import ast
import io
import re
import tokenize

import pytest
from test_house import LIBRARY, PLUGIN, ROOT, docstrings, python_files, tree_of

# A docstring says what is returned or done; these begin half a sentence, or stand for a standard verb.
NO_FIRST_WORD = re.compile(
    r"\W*(?:Of|What|By|That|Those|Where|Whose|Which|Who|For|As|How|Why|When|Else|Tell|Say|Lead)\b"
)

NO_PHRASES = re.compile(
    r"gone on with|\bso (?:many|often)\b|\b(?:is|are|was|were|be) (?:told|led)\b|\btold (?:by|of)\b|\bturns? round\b"
    r"|\bwhat slides\b|\bthe asked\b|\bnobody (?:says|said|knows)\b|\bwhen left out\b|\bsmall rests?\b"
    r"|\bwhich (?:is|are) none\b|\bvalues that are none\b|\bas far as it is\b"
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
    "python": (python_files(LIBRARY), python_docs, python_words),
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


@pytest.mark.parametrize("language", SOURCES)
def test_no_phrase_is_private_dialect(language):
    paths, _, words_of = SOURCES[language]
    texts = [(path.relative_to(ROOT), one_line(text)) for path in paths for text in words_of(path)]
    found = [(str(path), NO_PHRASES.search(text)) for path, text in texts]
    assert [(path, match[0], match.string[:80]) for path, match in found if match] == []
