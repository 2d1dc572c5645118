"""Features of LAMMPS beside ours, analysis/stability/lammps_features.py: each works, or ends in one sentence."""

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "analysis" / "stability"))

import lammps_features
from features.feature import Outcome, judge
from lammps_features import FEATURES

pytestmark = pytest.mark.lammps

# Those that stand for the rest where tests must be quick.
QUICK = (
    "`run_style respa`",
    "`timestep -0.1`",
    "`timestep`, then `run pre no`",
    "`fix dt/reset`: box",
    "`minimize` between runs: strain",
    "`fix nve`",
    "`fix deposit`",
    "`velocity`: pressure",
    "`displace_atoms`, then `run pre no`",
)


def marked(feature):
    marks = [] if feature.name in QUICK else [pytest.mark.validate]
    return pytest.param(feature, id=feature.name, marks=marks)


@pytest.mark.parametrize("feature", [marked(one) for one in FEATURES])
def test_a_feature_works_or_is_refused(feature):
    outcome = judge(feature)
    assert outcome.holds, outcome.found


def test_each_feature_has_a_name_of_its_own():
    names = [one.name for one in FEATURES]
    assert len(set(names)) == len(names)
    assert set(QUICK) <= set(names)


def test_what_does_not_hold_is_seen():
    """A wrong number, a sentence that is none, a warning that is missing."""
    (halt,) = [one for one in FEATURES if one.name == "`timestep`, then `run pre no`"]
    wrong = halt._replace(right=19.0)
    outcome = judge(wrong)
    assert outcome.works
    assert not outcome.holds
    assert lammps_features.line_of(wrong, outcome).startswith(f"| {wrong.name} | **works** |")
    assert not judge(halt._replace(refused=".*")).holds
    assert not judge(halt._replace(warned="nothing of the kind")).holds
    assert judge(halt._replace(commands="fix f all none")) == Outcome(
        False, "Unrecognized fix style 'none'", False
    )


def test_the_page_has_every_feature():
    page = (ROOT / "docs" / "results" / "stability.md").read_text()
    rows = re.findall(r"^\| (.*?) \| (works|refused) \| .* \|$", page, re.MULTILINE)
    expected = [(one.name, "refused" if one.refused else "works") for one in FEATURES]
    assert [row for row in rows if row[0] in {name for name, _ in expected}] == expected
