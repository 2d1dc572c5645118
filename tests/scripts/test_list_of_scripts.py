"""The list of the analysis scripts."""

from pathlib import Path

ANALYSIS = Path(__file__).parents[2] / "analysis"


def test_every_script_is_listed():
    listed = (ANALYSIS / "README.md").read_text()
    scripts = [p for p in ANALYSIS.rglob("*.py") if '__name__ == "__main__"' in p.read_text()]
    names = [path.relative_to(ANALYSIS).as_posix() for path in sorted(scripts)]
    assert [name for name in names if f"| `{name}` |" not in listed] == []
