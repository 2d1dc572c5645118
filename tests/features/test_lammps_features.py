"""Features of LAMMPS beside ours: each works, by a number, or is refused, by a sentence.

The table of docs/results/stability.md is written by
`python -m pytest tests/features -m "" --report runs/lammps_features.md`.
"""

import re
from pathlib import Path

import pytest
from feature import Outcome, judge
from features_of_contacts import CONTACTS
from features_of_motion import MOVING

ROOT = Path(__file__).parents[2]
FEATURES = (*MOVING, *CONTACTS)

pytestmark = pytest.mark.lammps

# A process each: the daily ones are those that have failed users, and those that stand for others.
DAILY = {
    "`run_style respa`", "`timestep -0.1`", "`timestep`, then `run pre no`", "`fix dt/reset`: box",
    "`minimize` between runs: strain", "`fix nve`", "`velocity`: pressure", "`displace_atoms`, then `run pre no`",
    "`atom_style hybrid ellipsoid molecular`", "`units real`", "`pair_style hybrid`, `minimize`",
    "`pair_style hybrid`, other atoms without a shape", "`special_bonds lj 0.5`", "`write_coeff`",
    "`write_data`, `read_data`", "restart file to data file, in a deck", "`rerun` of rods",
    "`fix setforce 0 0 0`, `minimize`", "`fix freeze`, `minimize`", "`fix adapt` of mixed k_e",
    "`law hertz`", "`law hertz`, restart file", "`law power 3` of superellipsoids, restart file", "`law power 1.5`",
    "`fix deposit`", "`set shape` before `run pre no`", "`fix rigid` in the plane",
}  # fmt: skip


def marked(feature):
    marks = () if feature.name in DAILY else (pytest.mark.validate,)
    return pytest.param(feature, marks=marks, id=feature.name)


def row_of(feature, outcome):
    word = "works" if outcome.works else "refused"
    word = word if outcome.holds else f"**{word}**"
    return {"feature": feature.name, "outcome": word, "what decides": outcome.found}


@pytest.mark.parametrize("feature", [marked(one) for one in FEATURES])
def test_a_feature_works_or_is_refused(feature, table_row):
    outcome = judge(feature)
    table_row("LAMMPS features", row_of(feature, outcome))
    assert outcome.holds, outcome.found


def test_each_feature_has_a_name_of_its_own():
    names = [one.name for one in FEATURES]
    assert len(set(names)) == len(names)
    assert set(names) >= DAILY


def test_what_does_not_hold_is_seen():
    """A wrong number, a sentence that is none, a warning that is missing."""
    (halt,) = [one for one in FEATURES if one.name == "`timestep`, then `run pre no`"]
    wrong = halt._replace(right=19.0)
    outcome = judge(wrong)
    assert outcome.works
    assert not outcome.holds
    assert row_of(wrong, outcome)["outcome"] == "**works**"
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
